// This machine's IIDC cameras. libdc1394 finds them and carries their registers, on IEEE 1394 and on USB.
#include <dc1394/dc1394.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <utility>

#include "hal/linux/iidc/bus.h"
#include "hal/linux/iidc/ring_source.h"
#include "hal/linux/iidc/usb_source.h"
#include "protocol/base/text.h"
#include "protocol/files/open_file.h"

namespace nodal::hal::iidc {
namespace {

constexpr std::size_t kLongestText = 64;
constexpr const char* kSysfs = "/sys";

struct Freer {
  void operator()(dc1394_t* context) const { dc1394_free(context); }
  void operator()(dc1394camera_t* camera) const { dc1394_camera_free(camera); }
  void operator()(dc1394camera_list_t* list) const { dc1394_camera_free_list(list); }
};
using Context = std::unique_ptr<dc1394_t, Freer>;
using CameraPointer = std::unique_ptr<dc1394camera_t, Freer>;
using List = std::unique_ptr<dc1394camera_list_t, Freer>;

std::string label_of(const char* text) { return text == nullptr ? "" : printable(text, kLongestText); }

std::string device_node(int bus, int address) {
  std::array<char, 64> path{};
  std::snprintf(path.data(), path.size(), "/dev/bus/usb/%03d/%03d", bus, address);
  return path.data();
}

/// Whether the kernel has a device on IEEE 1394 with this GUID.
bool on_1394(std::uint64_t guid) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(kSysfs) + "/bus/firewire/devices", error)) {
    std::array<char, 32> text{};
    const Result<FilePtr> file = open_to_read(entry.path() / "guid");
    if (file && std::fgets(text.data(), text.size(), file->get()) && std::strtoull(text.data(), nullptr, 16) == guid)
      return true;
  }
  return false;
}

std::vector<std::uint64_t> guids(dc1394_t* context) {
  dc1394camera_list_t* found = nullptr;
  if (dc1394_camera_enumerate(context, &found) != DC1394_SUCCESS) return {};
  const List list(found);
  std::vector<std::uint64_t> all;
  for (std::uint32_t i = 0; i < list->num; ++i) all.push_back(list->ids[i].guid);
  return all;
}

class Dc1394Device final : public Device {
 public:
  Dc1394Device(Context context, CameraPointer camera) : context_(std::move(context)), camera_(std::move(camera)) {
    info_.guid = camera_->guid;
    info_.vendor = label_of(camera_->vendor);
    info_.model = label_of(camera_->model);
    info_.command_base = camera_->command_registers_base;
    const char* platform = nullptr;
    dc1394_camera_get_platform_string(camera_.get(), &platform);
    if (std::string_view(platform == nullptr ? "" : platform) != "usb") return;
    std::uint32_t address = 0, bus = 0;  // on USB they take the place of node and generation
    dc1394_camera_get_node(camera_.get(), &address, &bus);
    bus_ = static_cast<int>(bus);
    address_ = static_cast<int>(address);
    info_.usb = device::usb_place_at(kSysfs, bus_, address_).value_or(device::UsbPlace{bus_, 0, 0});
  }

  const CameraInfo& info() const override { return info_; }
  int read(std::uint64_t offset, std::uint32_t& value) override {
    return errno_of(dc1394_get_registers(camera_.get(), offset, &value, 1));
  }
  int write(std::uint64_t offset, std::uint32_t value) override {
    return errno_of(dc1394_set_registers(camera_.get(), offset, &value, 1));
  }
  bool gone() const override {
    return info_.usb ? ::access(device_node(bus_, address_).c_str(), F_OK) != 0 : !on_1394(info_.guid);
  }
  int make_source(std::size_t buffers, std::size_t frame_bytes, std::unique_ptr<FrameSource>& source) override {
    if (info_.usb) return make_usb_source(bus_, address_, buffers, frame_bytes, source);
    source = make_ring_source(camera_.get(), buffers, frame_bytes);
    return 0;
  }

 private:
  int errno_of(dc1394error_t error) const {
    if (error == DC1394_SUCCESS) return 0;
    return gone() ? ENODEV : EIO;
  }

  const Context context_;
  const CameraPointer camera_;
  CameraInfo info_;
  int bus_ = 0, address_ = 0;
};

class Dc1394Bus final : public Bus {
 public:
  Dc1394Bus() {
    // What goes wrong is in the errors; by default the library writes it to standard error, too.
    for (const dc1394log_t type : {DC1394_LOG_ERROR, DC1394_LOG_WARNING, DC1394_LOG_DEBUG}) {
      dc1394_log_register_handler(
          type, [](dc1394log_t, const char*, void*) {}, nullptr);
    }
  }

  int open(std::uint64_t guid, std::unique_ptr<Device>& device) override {
    Context context(dc1394_new());
    if (!context) return EIO;
    const std::vector<std::uint64_t> all = guids(context.get());
    if (std::find(all.begin(), all.end(), guid) == all.end()) return ENODEV;
    CameraPointer camera(dc1394_camera_new(context.get(), guid));
    if (!camera) return EBUSY;  // it answered a moment ago
    device = std::make_unique<Dc1394Device>(std::move(context), std::move(camera));
    return 0;
  }

  /// Only the GUIDs: for more, libdc1394 would open the cameras, which resets their USB configuration.
  std::vector<CameraInfo> list() override {
    const Context context(dc1394_new());
    std::vector<CameraInfo> infos;
    if (!context) return infos;
    for (const std::uint64_t guid : guids(context.get())) {
      CameraInfo info;
      info.guid = guid;
      infos.push_back(std::move(info));
    }
    return infos;
  }
};

}  // namespace

Bus& cameras() {
  static Dc1394Bus bus;
  return bus;
}

}  // namespace nodal::hal::iidc
