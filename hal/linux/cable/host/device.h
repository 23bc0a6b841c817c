// USB devices that are rigs, found and opened with libusb.
#pragma once

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "hal/linux/cable/host/cable_link.h"
#include "protocol/base/result.h"

namespace nodal::hal::cable {

struct CloseContext {
  void operator()(libusb_context* context) const { libusb_exit(context); }
};
struct CloseDevice {
  void operator()(libusb_device_handle* device) const { libusb_close(device); }
};

/// A rig's interface, claimed: no other program of this machine can use it meanwhile.
struct OpenDevice {
  std::unique_ptr<libusb_context, CloseContext> context;
  std::unique_ptr<libusb_device_handle, CloseDevice> handle;
  std::string text;  ///< "usb:SERIAL", for messages
  int interface = 0;
  std::uint8_t to_rig = 0;  ///< endpoint addresses
  std::uint8_t from_rig = 0;
};

/// As connect_cable().
Result<OpenDevice> open_device(std::string_view serial);

}  // namespace nodal::hal::cable
