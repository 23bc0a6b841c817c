#include "hal/linux/iidc/enumerator.h"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <string_view>
#include <utility>

#include "hal/linux/iidc/head.h"
#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

constexpr std::string_view kScheme = "iidc:";

std::optional<std::uint64_t> guid_in(std::string_view path) {
  path.remove_prefix(kScheme.size());
  if (path.starts_with("0x")) path.remove_prefix(2);
  std::uint64_t guid = 0;
  const auto [end, error] = std::from_chars(path.data(), path.data() + path.size(), guid, 16);
  if (error != std::errc() || end != path.data() + path.size()) return std::nullopt;
  return guid;
}

Error no_such_camera(Bus& bus, const std::string& path) {
  std::string connected;
  for (const CameraInfo& info : bus.list()) connected += (connected.empty() ? "" : ", ") + port_of(info.guid);
  return {Errc::kNoSuchDevice,
          "head '" + path + "': there is no such IIDC camera; there is: " + (connected.empty() ? "none" : connected)};
}

/// Its part of the bandwidth of its bus; null for cameras on IEEE 1394, whose bus refuses by itself.
Result<device::UsbBuses::Share> claim_bandwidth(device::UsbBuses& buses, const std::string& path,
                                                const CameraInfo& info, const Granted& granted) {
  if (!info.usb) return device::UsbBuses::Share();
  const HeadFormat& format = granted.format;
  const auto bytes = static_cast<std::int64_t>(granted.frame_bytes) * format.rate.numerator / format.rate.denominator;
  return buses.claim(*info.usb, bytes, path,
                     fmt::format("{} {}x{} at {}/{} frames a second", pixel_format_name(format.pixels), format.width,
                                 format.height, format.rate.numerator, format.rate.denominator));
}

Result<std::shared_ptr<device::Channel>> open_channel(Bus& bus, device::UsbBuses& buses, const std::string& path,
                                                      const HeadRequest& request) {
  const auto guid = guid_in(path);
  if (!guid) return fail(no_such_camera(bus, path));
  std::unique_ptr<Device> device;
  const int error = bus.open(*guid, device);
  if (error == ENODEV) return fail(no_such_camera(bus, path));
  if (error != 0) return fail(explain(path, "opening the camera", error));
  auto camera = std::make_unique<Camera>(std::move(device), path);
  NODAL_TRY(camera->prepare());
  NODAL_TRY_ASSIGN(auto granted, negotiate(*camera, path, request));
  NODAL_TRY_ASSIGN(auto share, claim_bandwidth(buses, path, camera->info(), granted));
  NODAL_TRY_ASSIGN(auto controls, Controls::find(*camera, request));
  NODAL_TRY_ASSIGN(const auto embedded, switch_on_embedded(*camera));
  NODAL_TRY_ASSIGN(const auto settings, controls->read(*camera));
  return std::make_shared<Channel>(std::move(camera), request, std::move(granted), std::move(controls), settings,
                                   embedded, std::move(share));
}

}  // namespace

IidcEnumerator::IidcEnumerator(ClockPort& clock, Bus& bus, const device::UsbBuses& buses)
    : DeviceEnumerator(clock, std::string(kScheme), "an IIDC head's"), bus_(bus), buses_(buses) {}

void IidcEnumerator::request(const std::string& path, const HeadRequest& request) {
  set_attempt(path, attempt(path, request));
}

device::DeviceEnumerator::Attempt IidcEnumerator::attempt(const std::string& path, const HeadRequest& request) {
  return [&bus = bus_, buses = buses_, path, request]() mutable -> Opened {
    return open_channel(bus, buses, path, request);
  };
}

std::unique_ptr<HeadPort> IidcEnumerator::make_head(const std::string& path, std::shared_ptr<device::Channel> channel,
                                                    device::Worker& worker, ClockPort& clock,
                                                    std::shared_ptr<bool> in_use) {
  return std::make_unique<IidcHead>(path, std::static_pointer_cast<Channel>(std::move(channel)), worker, clock,
                                    std::move(in_use));
}

std::vector<HeadIdentity> IidcEnumerator::list() {
  std::vector<HeadIdentity> all;
  for (const CameraInfo& info : bus_.list()) {
    const std::string path = port_of(info.guid);
    all.push_back({path, path.substr(kScheme.size()), info.vendor + " " + info.model});
  }
  return all;
}

}  // namespace nodal::hal::iidc
