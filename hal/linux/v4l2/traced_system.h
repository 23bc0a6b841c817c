// Writes each call to V4L2 drivers down: for whoever connects a camera for the first time.
#pragma once

#include <map>
#include <mutex>
#include <string>

#include "hal/clock.h"
#include "hal/linux/v4l2/system.h"
#include "hal/trace.h"

namespace nodal::hal::v4l2 {

/// Passes every call on, and writes a line about it:
///
///     /dev/video0: VIDIOC_S_FMT 640x480 YUYV, progressive, 0 bytes, 0 a row -> 640x480 YUYV, progressive, 614400
///       bytes, 1280 a row
///     /dev/video0: VIDIOC_S_CTRL EXPOSURE_ABSOLUTE = 156 -> EINVAL (Invalid argument)
///
/// Calls that took 5 ms or more end with their time. A healthy stream often calls VIDIOC_DQBUF before there is a frame,
/// so these calls are written only when no frame came for a second: "no frame for 1003 ms, asked 31 times".
///
/// Threading: thread-safe, as System; lines of one descriptor may come from two threads.
/// Ownership: `system` and `clock` outlive it.
class TracedSystem final : public System {
 public:
  TracedSystem(System& system, ClockPort& clock, TraceLine write)
      : system_(system), clock_(clock), write_(std::move(write)) {}

  int open(const std::string& node) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  std::uint8_t* map(int fd, std::size_t length, std::size_t offset) override;
  void unmap(std::uint8_t* start, std::size_t length) override { system_.unmap(start, length); }
  std::vector<std::string> nodes() override { return system_.nodes(); }
  std::optional<device::UsbPlace> usb(const std::string& node) override { return system_.usb(node); }

 private:
  /// An open descriptor.
  struct Open {
    std::string node;
    int asked = 0;  ///< calls of VIDIOC_DQBUF without a frame since the last line about them
    Instant frame;  ///< when the last frame came, or the stream began
    Instant line;   ///< when the newest line about missing frames was written, or as `frame`
  };

  std::string node_of(int fd);
  void note_frame(int fd, Instant now);
  /// Counts a VIDIOC_DQBUF without a frame; the line about it when one is due, or nothing.
  std::string count_empty(int fd, Instant now);

  System& system_;
  ClockPort& clock_;
  const TraceLine write_;
  std::mutex mutex_;  ///< protects open_
  std::map<int, Open> open_;
};

}  // namespace nodal::hal::v4l2
