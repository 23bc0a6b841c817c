// The buffers of one V4L2 capture stream.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hal/head.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/negotiation.h"

namespace nodal::hal::v4l2 {

/// Nothing that the driver says is believed: an index, a length or a size that cannot be is an error or a bad verdict,
/// and memory outside the mapped buffers is never touched.
///
/// Threading: one thread at a time. begin(), end() and restart() may take seconds; queue() and dequeue() never wait.
/// Ownership: owns the mappings; the device outlives it.
class Stream {
 public:
  Stream(const Device& device, const Granted& granted) : device_(device), granted_(granted) {}
  ~Stream() { end(); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Asks for `buffers` and takes what it is granted, queues them all and starts.
  Status begin(int buffers);
  /// Stops, and gives the buffers back to the driver. Safe at any time.
  void end();
  /// Stops, queues `slots` and starts again; the other buffers keep what they hold.
  Status restart(const std::vector<BufferSlot>& slots);

  std::size_t buffers() const { return buffers_.size(); }
  /// 0 or an errno.
  int queue(BufferSlot slot);

  struct Frame {
    BufferSlot slot = 0;
    std::uint32_t sequence = 0;
    std::uint32_t flags = 0;
    std::uint32_t field = 0;
    Instant timestamp;
    FrameVerdict verdict = FrameVerdict::kGood;
  };
  /// An errno: EAGAIN when no frame is due, EBADMSG when the driver's answer cannot be true. 0: `frame` is filled.
  int dequeue(Frame& frame);
  /// The whole picture, whatever came of it.
  MutableImageView picture(BufferSlot slot) const;

 private:
  struct Plane {
    std::uint8_t* start = nullptr;
    std::size_t length = 0;
    std::size_t offset = 0;  ///< of the picture in the newest frame; multi-planar drivers may put a header before it
  };
  struct Buffer {
    std::array<Plane, kMaxPlanes> planes{};
    bool queued = false;
  };
  /// A v4l2_buffer, and the planes that it points to when the device is multi-planar.
  struct Call {
    v4l2_buffer buffer{};
    std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};
  };
  void prepare(Call& call, std::uint32_t index) const;
  Status map(std::uint32_t index);
  Status fail_with(const std::string& doing, int error) { return fail(device_.explained(doing, error)); }

  const Device& device_;
  const Granted& granted_;
  std::vector<Buffer> buffers_;
  bool allocated_ = false;  ///< by the driver
};

}  // namespace nodal::hal::v4l2
