#include "hal/linux/v4l2/enumerator.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <chrono>
#include <future>
#include <numeric>
#include <optional>
#include <utility>

#include "hal/linux/v4l2/head.h"
#include "hal/linux/v4l2/worker.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr std::string_view kScheme = "v4l2:";

using Opened = Result<std::shared_ptr<Channel>>;

/// 0 for JPEGs: their size is unknown before they arrive, and the device itself reserves what it needs.
std::int64_t bytes_per_second(const Granted& granted) {
  if (granted.format.pixels == PixelFormat::kMjpeg) return 0;
  const auto& needed = granted.layout.needed;
  const auto frame =
      std::accumulate(needed.begin(), needed.end(), std::int64_t{0},
                      [](std::int64_t sum, std::size_t one) { return sum + static_cast<std::int64_t>(one); });
  return frame * granted.format.rate.numerator / granted.format.rate.denominator;
}

/// Its part of the bandwidth of its bus; null for devices that are not on USB.
Result<UsbBuses::Share> claim_bandwidth(System& system, UsbBuses& buses, const std::string& path, const Device& device,
                                        const Granted& granted) {
  const auto usb = system.usb(device.node());
  if (!usb) return UsbBuses::Share();
  const HeadFormat& format = granted.format;
  return buses.claim(*usb, bytes_per_second(granted), path,
                     std::string(pixel_format_name(format.pixels)) + " " + std::to_string(format.width) + "x" +
                         std::to_string(format.height) + " at " + std::to_string(format.rate.numerator) + "/" +
                         std::to_string(format.rate.denominator) + " frames a second");
}

Opened open_channel(System& system, UsbBuses& buses, const std::string& path, const HeadRequest& request) {
  auto device = open_device(system, path, path.substr(kScheme.size()));
  if (!device) return fail(device.error());
  auto granted = negotiate(**device, request);
  if (!granted) return fail(granted.error());
  auto share = claim_bandwidth(system, buses, path, **device, *granted);
  if (!share) return fail(share.error());
  auto controls = Controls::find(**device, request.gain_step_mdb);
  if (!controls) return fail(controls.error());
  const auto settings = controls->read(**device);
  if (!settings) return fail(settings.error());
  return std::make_shared<Channel>(std::move(*device), request, std::move(*granted), std::move(*controls), *settings,
                                   std::move(*share));
}

}  // namespace

struct V4l2Enumerator::Path {
  HeadRequest request;
  std::shared_ptr<bool> in_use = std::make_shared<bool>(false);
  std::weak_ptr<Channel> channel;  ///< of the head that uses the device
  std::optional<std::future<Opened>> opening;
  std::optional<Error> last;
  Worker worker;  ///< declared last, so destroyed first: its jobs use the members above
};

V4l2Enumerator::V4l2Enumerator(ClockPort& clock, System& system) : clock_(clock), system_(system) {}

V4l2Enumerator::~V4l2Enumerator() {
  for (const auto& [name, path] : paths_) NODAL_ASSERT(!*path->in_use);  // destroy heads first
}

V4l2Enumerator::Path& V4l2Enumerator::at(const std::string& path) {
  std::unique_ptr<Path>& found = paths_[path];
  if (!found) found = std::make_unique<Path>();
  return *found;
}

void V4l2Enumerator::request(const std::string& path, const HeadRequest& request) {
  Path& one = at(path);
  one.request = request;
  one.opening.reset();  // an attempt in progress used the previous request
}

Result<std::unique_ptr<HeadPort>> V4l2Enumerator::open(const std::string& path) {
  if (!path.starts_with(kScheme)) {
    return fail(Errc::kNoSuchDevice, "head '" + path + "': a V4L2 head's path begins with 'v4l2:'");
  }
  Path& one = at(path);
  if (*one.in_use) {
    // A head from which no frame was requested since its device went has not yet detected that it is gone.
    const std::shared_ptr<Channel> channel = one.channel.lock();
    v4l2_capability capability{};
    if (!channel || channel->device->ioctl(VIDIOC_QUERYCAP, &capability) != ENODEV) {
      return fail(Errc::kBusy, "head '" + path + "': is open already");
    }
    *std::exchange(one.in_use, std::make_shared<bool>(false)) = false;
  }
  if (!one.opening) {
    auto job = std::make_shared<std::packaged_task<Opened()>>(
        [&system = system_, &buses = buses_, path, request = one.request] {
          return open_channel(system, buses, path, request);
        });
    one.opening = job->get_future();
    one.worker.post([job] { (*job)(); });
  }
  if (one.opening->wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    if (one.last) return fail(*one.last);
    return fail(Errc::kNotReady, "head '" + path + "': is being opened");
  }
  Opened opened = one.opening->get();
  one.opening.reset();
  if (!opened) {
    one.last = opened.error();
    return fail(opened.error());
  }
  one.last.reset();
  one.channel = *opened;
  return std::make_unique<V4l2Head>(path, std::move(*opened), one.worker, clock_, one.in_use);
}

std::vector<HeadIdentity> V4l2Enumerator::list() { return list_devices(system_); }

Result<std::unique_ptr<HeadPort>> V4l2Enumerator::open_and_wait(const std::string& path) {
  if (path.starts_with(kScheme)) {
    Path& one = at(path);
    one.worker.settle();
    if (!one.opening) {
      auto at_once = open(path);
      if (!one.opening) return at_once;  // the device answered at once, or no attempt was made
    }
    one.worker.settle();
  }
  return open(path);
}

void V4l2Enumerator::settle() {
  for (const auto& [name, path] : paths_) path->worker.settle();
}

}  // namespace nodal::hal::v4l2
