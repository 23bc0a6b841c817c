// The system calls that a V4L2 head makes, so that tests can put a driver of their own in their place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal::v4l2 {

/// Threading: thread-safe, as the calls themselves are.
/// Errors: errno values, never through errno.
class System {
 public:
  virtual ~System() = default;
  /// A descriptor for reading and writing that never waits for a frame, or a negative errno.
  virtual int open(const std::string& node) = 0;
  virtual void close(int fd) = 0;
  /// 0 or an errno. An interrupted call is made again.
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  /// Null when the kernel refuses.
  virtual std::uint8_t* map(int fd, std::size_t length, std::size_t offset) = 0;
  virtual void unmap(std::uint8_t* start, std::size_t length) = 0;
  /// Every /dev/videoN, in the order of N.
  virtual std::vector<std::string> nodes() = 0;
};

/// This machine's kernel.
System& kernel();

/// What a failed call means, in one sentence with what to do about it. `who` names the head, `doing` says what was
/// tried, such as "starting the stream".
Error explain(const std::string& who, const std::string& doing, int error);

}  // namespace nodal::hal::v4l2
