// The system calls of a V4L2 head, as an interface, so that tests can replace the driver.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/device/usb.h"
#include "protocol/base/result.h"

namespace nodal::hal::v4l2 {

/// Threading: thread-safe, like the system calls.
/// Errors: returned as errno values, not in errno.
class System {
 public:
  virtual ~System() = default;
  /// A descriptor for reading and writing that never blocks, or a negative errno.
  virtual int open(const std::string& node) = 0;
  virtual void close(int fd) = 0;
  /// Returns 0 or an errno. Repeats an interrupted call.
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  /// Null if the kernel refuses.
  virtual std::uint8_t* map(int fd, std::size_t length, std::size_t offset) = 0;
  virtual void unmap(std::uint8_t* start, std::size_t length) = 0;
  /// All /dev/videoN, in the order of N.
  virtual std::vector<std::string> nodes() = 0;
  /// Nothing if the device of `node` is not on USB.
  virtual std::optional<device::UsbPlace> usb(const std::string& node) = 0;
};

/// This machine's kernel.
System& kernel();

/// Explains a failed call in one sentence, with the remedy. `who` names the head; `doing` is the attempted action, such
/// as "starting the stream".
Error explain(const std::string& who, const std::string& doing, int error);

}  // namespace nodal::hal::v4l2
