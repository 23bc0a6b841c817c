// A fake V4L2 driver in virtual time: it follows the specification, until a test makes it fail or return wrong data.
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/linux/v4l2/system.h"
#include "protocol/base/units.h"

namespace nodal::test {

/// One device at /dev/video7, whose card is "Camera" on bus "usb-1.2".
///
/// Threading: thread-safe. Set its properties before it is opened.
class V4l2Driver final : public hal::v4l2::System {
 public:
  explicit V4l2Driver(hal::ClockPort& clock) : clock_(clock) {}

  // The device's properties.
  std::vector<std::uint32_t> formats{V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_YUV420, V4L2_PIX_FMT_GREY};
  bool multiplanar = false;
  std::uint32_t width = 48, height = 32;
  std::uint32_t padding = 16;  ///< bytes after each row
  /// The field order of its frames. With V4L2_FIELD_ALTERNATE, `height` is that of a field, each of which has a buffer.
  std::uint32_t field = V4L2_FIELD_NONE;
  std::set<std::uint64_t> lost_fields;  ///< numbers, from the start, of alternate fields that never arrive
  v4l2_std_id standard = 0;             ///< 0: it has no standards
  v4l2_fract period{1001, 30000};
  std::optional<hal::device::UsbPlace> place;  ///< on USB
  std::uint32_t most_buffers = 32, fewest_buffers = 2;
  std::uint32_t timestamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::uint32_t quantization = V4L2_QUANTIZATION_FULL_RANGE;
  std::uint32_t colorspace = V4L2_COLORSPACE_SMPTE170M, encoding = V4L2_YCBCR_ENC_601;
  std::vector<std::uint8_t> jpeg{0xFF, 0xD8, 0xFF, 0xD9};  ///< the frames of V4L2_PIX_FMT_MJPEG
  struct Control {
    std::int32_t low, high, step, usual, value;
  };
  std::map<std::uint32_t, Control> controls;  ///< by V4L2_CID_…

  // What a test controls.
  /// Called before a call: an errno makes it fail, 0 lets the driver answer. May block.
  std::function<int(unsigned long request)> before;
  /// Called after a successful call; may change the answer.
  std::function<void(unsigned long request, void* argument)> after;
  void unplug();
  void plug_in();
  int calls(unsigned long request) const;
  std::int32_t control(std::uint32_t id) const;
  int open_descriptors() const;
  bool is_open(int fd) const;
  /// What poll() says: a frame is due, or there is an error to read.
  bool readable(int fd);
  int mappings() const;

  // What the port uses.
  int open(const std::string& node) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  std::uint8_t* map(int fd, std::size_t length, std::size_t offset) override;
  void unmap(std::uint8_t* start, std::size_t length) override;
  std::vector<std::string> nodes() override { return {"/dev/video7"}; }
  std::optional<hal::device::UsbPlace> usb(const std::string&) override { return place; }

 private:
  struct Buffer {
    std::vector<std::vector<std::uint8_t>> planes;
    enum class State { kIdle, kQueued, kDone } state = State::kIdle;
    std::uint32_t sequence = 0;
    std::uint32_t field = 0;
    Instant end;
  };
  int answer(unsigned long request, void* argument);
  int format_call(unsigned long request, void* argument);
  int control_call(unsigned long request, void* argument);
  int buffer_call(unsigned long request, void* argument);
  int allocate(v4l2_requestbuffers& wanted);
  int describe(std::uint32_t index, v4l2_buffer& buffer);
  void expose();
  std::uint32_t planes() const;
  std::uint32_t stride(std::uint32_t plane) const;
  std::uint32_t size(std::uint32_t plane) const;

  hal::ClockPort& clock_;
  mutable std::mutex mutex_;
  std::map<int, bool> open_;  ///< by descriptor: whether the device was unplugged since
  int next_fd_ = 1000;
  int owner_ = -1;  ///< the descriptor that last requested buffers
  bool there_ = true;
  std::uint32_t code_ = V4L2_PIX_FMT_YUYV;
  std::vector<Buffer> buffers_;
  std::vector<Buffer> unplugged_;  ///< still mapped by their former owner
  std::deque<std::uint32_t> queued_, done_;
  bool streaming_ = false;
  Instant started_;
  std::uint64_t exposed_ = 0;
  int mappings_ = 0;
  std::map<unsigned long, int> calls_;
};

}  // namespace nodal::test
