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

/// Treats all data from the driver as untrusted: an impossible index, length or size is an error or a bad verdict, and
/// memory outside the mapped buffers is never accessed.
///
/// Threading: one thread at a time. begin(), end() and restart() may take seconds; queue() and dequeue() never wait.
/// Ownership: owns the mappings; refers to the device.
class Stream {
 public:
  Stream(const Device& device, const Granted& granted) : device_(device), granted_(granted) {}
  ~Stream() { end(); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Requests `buffers`, uses the number granted, queues them all and starts the stream.
  Status begin(int buffers);
  /// Stops the stream and returns the buffers to the driver. Safe at any time.
  void end();
  /// Stops, queues `slots` and starts again; the other buffers keep their content.
  Status restart(const std::vector<BufferSlot>& slots);

  std::size_t buffers() const { return buffers_.size(); }
  /// Returns 0 or an errno.
  int queue(BufferSlot slot);

  struct Frame {
    BufferSlot slot = 0;
    std::uint32_t sequence = 0;
    std::uint32_t flags = 0;
    std::uint32_t field = 0;
    Instant timestamp;
    FrameVerdict verdict = FrameVerdict::kGood;
  };
  /// Returns an errno: EAGAIN if no frame is due, EBADMSG if the driver's answer is impossible. 0: `frame` is filled.
  int dequeue(Frame& frame);
  /// The whole picture, even if the frame is bad.
  ImageView picture(BufferSlot slot) const;

 private:
  struct Plane {
    std::uint8_t* start = nullptr;
    std::size_t length = 0;
    /// Where the picture begins in the newest frame; multi-planar drivers may store a header before it.
    std::size_t offset = 0;
    std::size_t used = 0;  ///< bytes of the newest frame, from `offset` on
  };
  struct Buffer {
    std::array<Plane, kMaxPlanes> planes{};
    bool queued = false;
  };
  /// A v4l2_buffer, and its planes if the device is multi-planar.
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
  bool allocated_ = false;  ///< buffers of the driver
};

}  // namespace nodal::hal::v4l2
