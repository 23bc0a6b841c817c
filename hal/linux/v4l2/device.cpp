#include "hal/linux/v4l2/device.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include "hal/linux/v4l2/driver_text.h"

namespace nodal::hal::v4l2 {
namespace {

std::uint32_t capabilities_of(const v4l2_capability& capability) {
  return (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
}

bool captures(const v4l2_capability& capability) {
  const std::uint32_t caps = capabilities_of(capability);
  return (caps & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0 && (caps & V4L2_CAP_STREAMING) != 0;
}

struct Opened {
  std::unique_ptr<Device> device;
  int error = 0;         ///< errno of open() or VIDIOC_QUERYCAP
  bool captures = true;  ///< false: it is open, but is not a capture device
};

Opened open_node(System& system, const std::string& head, const std::string& node) {
  const int fd = system.open(node);
  if (fd < 0) return {nullptr, -fd, true};
  v4l2_capability capability{};
  const int error = system.ioctl(fd, VIDIOC_QUERYCAP, &capability);
  if (error != 0 || !captures(capability)) {
    system.close(fd);
    return {nullptr, error == EINVAL ? ENOTTY : error, error == 0 ? false : true};
  }
  return {std::make_unique<Device>(system, fd, head, node, capability), 0, true};
}

Error no_such(const std::string& head, const std::string& why) {
  return {Errc::kNoSuchDevice, "head '" + head + "': " + why};
}

std::string seen_devices(System& system) {
  std::string text;
  for (const HeadIdentity& identity : list_devices(system)) {
    text += (text.empty() ? "" : ", ") + identity.path + " (" + identity.model + ")";
  }
  return text.empty() ? "no V4L2 capture device can be opened" : "there are " + text;
}

Result<std::unique_ptr<Device>> open_path(System& system, const std::string& head, const std::string& node) {
  Opened opened = open_node(system, head, node);
  if (opened.device) return std::move(opened.device);
  if (!opened.captures) return fail(no_such(head, node + " does not capture video; take another node of the device"));
  switch (opened.error) {
    case ENOENT:
    case ENODEV:
    case ENXIO: return fail(no_such(head, node + " is not there; " + seen_devices(system)));
    case ENOTTY: return fail(no_such(head, node + " is no V4L2 device"));
    default: return fail(explain(head, "opening " + node, opened.error));
  }
}

}  // namespace

Device::Device(System& system, int fd, std::string head, std::string node, const v4l2_capability& capability)
    : system_(system),
      fd_(fd),
      head_(std::move(head)),
      node_(std::move(node)),
      capability_(capability),
      multiplanar_((capabilities_of(capability) & V4L2_CAP_VIDEO_CAPTURE) == 0) {}

Device::~Device() { system_.close(fd_); }

std::string Device::card() const { return text_of(capability_.card); }
std::string Device::bus() const { return text_of(capability_.bus_info); }
v4l2_buf_type Device::buffer_type() const {
  return multiplanar_ ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

Result<std::unique_ptr<Device>> open_device(System& system, const std::string& head, const std::string& name) {
  if (name.starts_with('/')) return open_path(system, head, name);
  for (const char* const folder : {"/dev/v4l/by-path/", "/dev/v4l/by-id/"}) {
    if (name.find('/') != std::string::npos) break;
    if (Opened opened = open_node(system, head, folder + name); opened.error != ENOENT) {
      return open_path(system, head, folder + name);
    }
  }
  std::vector<std::unique_ptr<Device>> on_bus;
  std::vector<std::unique_ptr<Device>> by_card;
  for (const std::string& node : system.nodes()) {
    Opened opened = open_node(system, head, node);
    if (!opened.device) continue;
    if (opened.device->bus() == name) {
      on_bus.push_back(std::move(opened.device));
    } else if (opened.device->card() == name) {
      by_card.push_back(std::move(opened.device));
    }
  }
  // Several nodes on one bus address are one device; the first is its main stream.
  if (!on_bus.empty()) return std::move(on_bus.front());
  if (by_card.size() == 1) return std::move(by_card.front());
  if (by_card.empty()) return fail(no_such(head, "no device has this name; " + seen_devices(system)));
  std::string all;
  for (const auto& device : by_card) all += (all.empty() ? "" : ", ") + device->node() + " on " + device->bus();
  return fail(Errc::kBadValue, "head '" + head + "': " + all + " all have this name; name the bus instead");
}

std::vector<HeadIdentity> list_devices(System& system) {
  std::vector<HeadIdentity> all;
  for (const std::string& node : system.nodes()) {
    const Opened opened = open_node(system, node, node);
    if (!opened.device) continue;
    const std::string by_bus = "v4l2:" + opened.device->bus();
    const bool taken = opened.device->bus().empty() ||
                       std::any_of(all.begin(), all.end(), [&](const HeadIdentity& one) { return one.path == by_bus; });
    all.push_back({taken ? "v4l2:" + node : by_bus, "", opened.device->card()});
  }
  return all;
}

}  // namespace nodal::hal::v4l2
