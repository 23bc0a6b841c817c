// Where a device is on USB, and how many bytes per second its bus can carry.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal::device {

struct UsbPlace {
  int bus = 0;              ///< number of the kernel's root hub; all devices of one share its bandwidth
  int bus_mbit = 0;         ///< speed of the root hub: 12, 480, 5000, ...
  int device_mbit = 0;      ///< speed of the device, which may be lower
  std::string serial = {};  ///< the device's own number; empty if it has none
};

/// Reads sysfs, whose root is `sysfs` (/sys), for a device node such as /dev/video0. Nothing if it is not on USB.
std::optional<UsbPlace> usb_place_of(const std::filesystem::path& sysfs, const std::string& node);
/// The same for the device with this address on a bus.
std::optional<UsbPlace> usb_place_at(const std::filesystem::path& sysfs, int bus, int address);

/// The most bytes of pictures per second that a bus or device of this speed can carry, whatever its kind of transfer; 0
/// if the speed is unknown. No transfer of USB 2.0 carries more than 13 packets of 512 bytes in a microframe of 125 us
/// (480 Mbit/s) or 19 of 64 bytes in a frame of 1 ms (12 Mbit/s; USB 2.0, tables 5-9 and 5-10). Faster ones lose their
/// line code: 8b/10b at 5 Gbit/s, 128b/132b above. Isochronous devices reserve more than they send, so the real limit
/// is lower.
std::int64_t usb_capacity(int mbit);

/// "53.2", for messages.
std::string megabytes(std::int64_t bytes);

/// The sums of all heads' data rates, by bus.
///
/// Threading: thread-safe.
class UsbBuses {
 public:
  /// A head's part; its destruction gives the bandwidth back. It may outlive the UsbBuses.
  using Share = std::shared_ptr<const void>;
  /// Errors: kBandwidth with the numbers, if the bus cannot carry `bytes_per_second` beside the others' shares. `who`
  /// names the head, `what` its mode.
  Result<Share> claim(const UsbPlace& place, std::int64_t bytes_per_second, const std::string& who,
                      const std::string& what);

 private:
  struct Ledger;
  std::shared_ptr<Ledger> ledger_ = make();
  static std::shared_ptr<Ledger> make();
};

}  // namespace nodal::hal::device
