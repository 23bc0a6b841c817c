// A head on a V4L2 capture device.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/linux/device/head.h"
#include "hal/linux/device/usb.h"
#include "hal/linux/v4l2/controls.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/field_weaver.h"
#include "hal/linux/v4l2/negotiation.h"
#include "hal/linux/v4l2/stream.h"

namespace nodal::hal::v4l2 {

class Channel final : public device::Channel {
 public:
  Channel(std::unique_ptr<Device> opened, const HeadRequest& asked, Granted given, Controls found, HeadSettings now,
          device::UsbBuses::Share bandwidth)
      : camera(std::move(opened)),
        request(asked),
        granted(std::move(given)),
        controls(std::move(found)),
        opened_with(now),
        share(std::move(bandwidth)),
        stream(*camera, granted) {}

  const HeadFormat& format() const override { return granted.format; }
  const HeadLimits& limits() const override { return controls.limits(); }
  const HeadSettings& settings() const override { return opened_with; }
  bool gone() const override;
  Status set(const device::ControlChange& change) override { return controls.set(*camera, change); }
  Result<HeadSettings> read() override { return controls.read(*camera); }
  void end() override { stream.end(); }

  const std::unique_ptr<Device> camera;
  const HeadRequest request;
  const Granted granted;
  const Controls controls;
  const HeadSettings opened_with;
  const device::UsbBuses::Share share;  ///< its share of the USB bus; null if the device is on none
  Stream stream;                        ///< see device::DeviceHead
  std::atomic<bool> no_signal{false};   ///< state of the input when it was last read
  std::atomic<bool> signal_asked{false};
};

/// take_frame() and release() call VIDIOC_DQBUF, on a non-blocking descriptor, and VIDIOC_QBUF. A thread that sleeps by
/// add_wake_ups() has poll() report which heads have a frame, and the others are not asked. Everything else is a job of
/// the worker. Stream errors are recovered by VIDIOC_STREAMOFF and STREAMON.
///
/// Threading, Ownership, Errors: as device::DeviceHead.
class V4l2Head final : public device::DeviceHead {
 public:
  V4l2Head(std::string path, std::shared_ptr<Channel> channel, device::Worker& worker, ClockPort& clock,
           std::shared_ptr<bool> in_use);

  Result<std::optional<FrameView>> take_frame() override;
  void add_wake_ups(WakeUps& to) const override;
  void release(BufferSlot slot) override;

 private:
  enum class Slot : std::uint8_t { kIdle, kQueued, kLent };

  Result<StreamJob> begin(TriggerMode trigger) override;
  void on_stream_start() override;
  void stopped() override;
  void queue_idle();
  void restart_stream();
  void watch_signal(Instant now);
  bool may_have_frame();
  void release_to_driver(BufferSlot slot);
  FrameView stamped(const Stream::Frame& frame, Instant now);
  FrameView view(const Stream::Frame& frame, Instant now);
  std::optional<FrameView> weave(const Stream::Frame& frame, Instant now);

  std::shared_ptr<Channel> channel_;
  std::vector<Slot> slots_;                   ///< the driver's buffers
  std::optional<FieldWeaver> weaver_;         ///< where fields arrive by themselves; it owns the lent frames
  std::optional<Stream::Frame> first_field_;  ///< first field of the frame that the weaver has not finished
  Instant next_signal_;
  /// Used if the thread sleeps by poll(): false if the driver has no frame, because poll() reported none or the newest
  /// frame has just been taken. Empty: the driver is asked.
  mutable std::optional<bool> ready_;
  mutable int skipped_ = 0;  ///< calls of take_frame() since the sleep that did not ask
};

}  // namespace nodal::hal::v4l2
