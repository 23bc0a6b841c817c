#include "hal/linux/v4l2/enumerator.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

#include "hal/linux/v4l2/head.h"
#include "protocol/base/try.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr std::string_view kScheme = "v4l2:";

using device::UsbBuses;

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
                     fmt::format("{} {}x{} at {}/{} frames a second", pixel_format_name(format.pixels), format.width,
                                 format.height, format.rate.numerator, format.rate.denominator));
}

Result<std::shared_ptr<Channel>> open_channel(System& system, UsbBuses& buses, const std::string& path,
                                              const HeadRequest& request) {
  NODAL_TRY_ASSIGN(auto device, open_device(system, path, path.substr(kScheme.size())));
  NODAL_TRY_ASSIGN(auto granted, negotiate(*device, request));
  NODAL_TRY_ASSIGN(auto share, claim_bandwidth(system, buses, path, *device, granted));
  NODAL_TRY_ASSIGN(auto controls, Controls::find(*device, request.gain_step_mdb));
  NODAL_TRY_ASSIGN(const auto settings, controls.read(*device));
  return std::make_shared<Channel>(std::move(device), request, std::move(granted), std::move(controls), settings,
                                   std::move(share));
}

}  // namespace

V4l2Enumerator::V4l2Enumerator(ClockPort& clock, System& system, const device::UsbBuses& buses)
    : DeviceEnumerator(clock, std::string(kScheme), "a V4L2 head's"), system_(system), buses_(buses) {}

void V4l2Enumerator::request(const std::string& path, const HeadRequest& request) {
  set_attempt(path, attempt(path, request));
}

device::DeviceEnumerator::Attempt V4l2Enumerator::attempt(const std::string& path, const HeadRequest& request) {
  return [&system = system_, buses = buses_, path, request]() mutable -> Opened {
    return open_channel(system, buses, path, request);
  };
}

std::unique_ptr<HeadPort> V4l2Enumerator::make_head(const std::string& path, std::shared_ptr<device::Channel> channel,
                                                    device::Worker& worker, ClockPort& clock,
                                                    std::shared_ptr<bool> in_use) {
  return std::make_unique<V4l2Head>(path, std::static_pointer_cast<Channel>(std::move(channel)), worker, clock,
                                    std::move(in_use));
}

std::vector<HeadIdentity> V4l2Enumerator::list() { return list_devices(system_); }

}  // namespace nodal::hal::v4l2
