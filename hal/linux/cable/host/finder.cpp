#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "hal/linux/cable/host/device.h"
#include "hal/linux/cable/records.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::hal::cable {
namespace {

constexpr std::size_t kLongestText = 128;

/// A rig and its libusb device, which is valid as long as the list that it is from.
struct Found {
  PluggedRig rig;
  libusb_device* device = nullptr;
  int interface = 0;
  std::uint8_t to_rig = 0;
  std::uint8_t from_rig = 0;
};

class DeviceList {
 public:
  explicit DeviceList(libusb_context* context) : count_(libusb_get_device_list(context, &devices_)) {}
  ~DeviceList() {
    if (devices_ != nullptr) libusb_free_device_list(devices_, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  libusb_device** begin() const { return devices_; }
  libusb_device** end() const { return devices_ + std::max<ssize_t>(count_, 0); }

 private:
  libusb_device** devices_ = nullptr;
  ssize_t count_;
};

Result<std::unique_ptr<libusb_context, CloseContext>> open_usb() {
  libusb_context* context = nullptr;
  if (const int error = libusb_init(&context); error != 0) {
    return fail(Errc::kIo, std::string("USB cannot be used: ") + libusb_strerror(error));
  }
  return std::unique_ptr<libusb_context, CloseContext>(context);
}

/// "1-2.3", the name of the device in /sys/bus/usb/devices.
std::string place_of(libusb_device* device) {
  std::array<std::uint8_t, 7> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string place = std::to_string(libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i) {
    place += fmt::format("{}{}", i == 0 ? "-" : ".", ports[static_cast<std::size_t>(i)]);
  }
  return place;
}

/// The kernel keeps the texts of devices where every user can read them, unlike the devices.
std::string text_of(const std::string& file) {
  std::string text(kLongestText, '\0');
  const Result<FilePtr> from = open_to_read("/sys/bus/usb/devices/" + file);
  text.resize(from ? std::fread(text.data(), 1, text.size(), from->get()) : 0);
  text.resize(std::min(text.size(), text.find('\n')));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

/// Nothing if the device is not a rig.
std::optional<Found> examine(libusb_device* device) {
  libusb_device_descriptor about{};
  if (libusb_get_device_descriptor(device, &about) != 0) return std::nullopt;
  if (about.idVendor != kVendor || about.idProduct != kProduct) return std::nullopt;
  libusb_config_descriptor* raw = nullptr;
  if (libusb_get_active_config_descriptor(device, &raw) != 0) return std::nullopt;
  const std::unique_ptr<libusb_config_descriptor, decltype(&libusb_free_config_descriptor)> config(
      raw, libusb_free_config_descriptor);
  for (std::uint8_t i = 0; i < config->bNumInterfaces; ++i) {
    if (config->interface[i].num_altsetting < 1) continue;
    const libusb_interface_descriptor& face = config->interface[i].altsetting[0];
    if (face.bInterfaceClass != kClass || face.bInterfaceSubClass != kSubclass ||
        face.bInterfaceProtocol != kProtocol) {
      continue;
    }
    Found found;
    found.device = device;
    found.interface = face.bInterfaceNumber;
    for (std::uint8_t e = 0; e < face.bNumEndpoints; ++e) {
      const libusb_endpoint_descriptor& endpoint = face.endpoint[e];
      if ((endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
      const bool in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
      (in ? found.from_rig : found.to_rig) = endpoint.bEndpointAddress;
    }
    if (found.to_rig == 0 || found.from_rig == 0) continue;
    const std::string place = place_of(device);
    found.rig = {text_of(place + "/serial"),
                 text_of(fmt::format("{}:{}.{}/interface", place, config->bConfigurationValue, found.interface)),
                 place};
    return found;
  }
  return std::nullopt;
}

std::vector<Found> examine_all(const DeviceList& devices) {
  std::vector<Found> rigs;
  for (libusb_device* device : devices) {
    if (auto found = examine(device)) rigs.push_back(std::move(*found));
  }
  return rigs;
}

std::string list(const std::vector<Found>& rigs) {
  std::string text;
  for (const Found& found : rigs) {
    text += (text.empty() ? "" : ", ") + std::string("usb:") + found.rig.serial + " ('" + found.rig.name + "' at " +
            found.rig.place + ")";
  }
  return text;
}

Result<Found> choose(const std::vector<Found>& rigs, std::string_view serial) {
  if (rigs.empty()) {
    return fail(Errc::kUnreachable,
                "no rig is plugged in by USB cable; check on the rig's board that nodald runs, that its rig.toml has "
                "[links] usb, and that nodal-cable.service runs (systemctl status nodal-cable)");
  }
  std::vector<Found> fitting = rigs;
  if (!serial.empty()) std::erase_if(fitting, [&](const Found& found) { return found.rig.serial != serial; });
  if (fitting.empty()) {
    return fail(Errc::kUnreachable,
                "no rig with serial '" + std::string(serial) + "' is plugged in; plugged in: " + list(rigs));
  }
  if (fitting.size() > 1) {
    return fail(Errc::kUnreachable,
                fmt::format("{} rigs are plugged in; name the serial of one: {}", fitting.size(), list(fitting)));
  }
  return fitting[0];
}

tl::unexpected<Error> cannot_open(const std::string& text, const std::string& place, int error) {
  if (error == LIBUSB_ERROR_ACCESS) {
    return fail(Errc::kUnreachable, text + ": this user may not use the USB device at " + place +
                                        "; install 60-nodal-host.rules in /etc/udev/rules.d (Debian package nodal has "
                                        "it), join group plugdev, and plug the cable again");
  }
  if (error == LIBUSB_ERROR_BUSY) {
    return fail(Errc::kBusy, text + ": another program of this machine uses the cable; a cable carries one host");
  }
  return fail(Errc::kUnreachable, text + ": the USB device at " + place + ": " + libusb_strerror(error));
}

/// Claims the interface. A host that was killed holds it until its link's process has said farewell, so a busy one is
/// asked again for a while. Returns 0 or libusb's error.
int claim(libusb_device_handle* handle, int interface) {
  constexpr auto kFarewellsEnd = std::chrono::milliseconds(2500);
  constexpr auto kAskAgain = std::chrono::milliseconds(50);
  const auto until = std::chrono::steady_clock::now() + kFarewellsEnd;
  int error = libusb_claim_interface(handle, interface);
  while (error == LIBUSB_ERROR_BUSY && std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(kAskAgain);
    error = libusb_claim_interface(handle, interface);
  }
  return error;
}

}  // namespace

Result<std::vector<PluggedRig>> plugged_rigs() {
  NODAL_TRY_ASSIGN(const auto context, open_usb());
  std::vector<PluggedRig> rigs;
  for (Found& found : examine_all(DeviceList(context.get()))) rigs.push_back(std::move(found.rig));
  return rigs;
}

Result<OpenDevice> open_device(std::string_view serial) {
  NODAL_TRY_ASSIGN(auto context, open_usb());
  OpenDevice open;
  open.context = std::move(context);
  const DeviceList devices(open.context.get());
  NODAL_TRY_ASSIGN(const auto chosen, choose(examine_all(devices), serial));
  open.text = "usb:" + chosen.rig.serial;
  open.interface = chosen.interface;
  open.to_rig = chosen.to_rig;
  open.from_rig = chosen.from_rig;
  libusb_device_handle* handle = nullptr;
  if (const int error = libusb_open(chosen.device, &handle); error != 0) {
    return cannot_open(open.text, chosen.rig.place, error);
  }
  open.handle.reset(handle);
  if (const int error = claim(handle, open.interface); error != 0) {
    return cannot_open(open.text, chosen.rig.place, error);
  }
  return open;
}

}  // namespace nodal::hal::cable
