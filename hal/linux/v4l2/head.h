// A head on a V4L2 capture device.
#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/v4l2/controls.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/field_weaver.h"
#include "hal/linux/v4l2/negotiation.h"
#include "hal/linux/v4l2/stream.h"
#include "hal/linux/v4l2/worker.h"

namespace nodal::hal::v4l2 {

/// An open device that is set up, shared by the head and by the jobs that its worker still has.
struct Channel {
  Channel(std::unique_ptr<Device> opened, const HeadRequest& asked, Granted given, Controls found, HeadSettings now,
          UsbBuses::Share bandwidth)
      : device(std::move(opened)),
        request(asked),
        granted(std::move(given)),
        controls(std::move(found)),
        settings(now),
        share(std::move(bandwidth)),
        stream(*device, granted),
        reported(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}
  ~Channel() {
    if (reported >= 0) ::close(reported);
  }
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  const std::unique_ptr<Device> device;
  const HeadRequest request;
  const Granted granted;
  const Controls controls;
  const HeadSettings settings;  ///< at the time of opening
  const UsbBuses::Share share;  ///< of its USB bus; null if it is on none
  /// Used by the worker from the posting of a job for it until its report is taken, else by the head.
  Stream stream;

  /// The result of a worker's job.
  struct Report {
    enum class About : std::uint8_t { kStream, kControls, kSignal } about = About::kStream;
    std::uint64_t start = 0;  ///< kStream: the start that it belongs to
    Instant at;               ///< when the calls returned
    std::optional<Error> error;
    HeadSettings settings;   ///< kControls
    bool no_signal = false;  ///< kSignal
  };
  const int reported;            ///< an eventfd, readable while there are reports; -1 if the system refused it
  std::mutex mutex;              ///< protects the following members
  std::vector<Report> reports;   ///< from the worker to the head
  ControlChange wanted;          ///< from the head to the worker: settings to apply, newer values replace older ones
  bool controls_posted = false;  ///< a job that applies `wanted` is queued
};

/// Calls that may take seconds (start, stop, controls, signal state) run as jobs of the device's worker. take_frame()
/// and release() make only calls that never wait (VIDIOC_DQBUF on a non-blocking descriptor, VIDIOC_QBUF) and take the
/// jobs' reports. So start() and set_…() return before the device acts: take_frame() returns the error of a start that
/// failed, and after a control that failed FrameView::in_effect is unchanged.
///
/// Threading: thread-bound to capture.
/// Ownership: refers to the worker and the clock. The destructor posts a job that closes the device.
/// Errors: as HeadPort. Stream errors are recovered by VIDIOC_STREAMOFF and STREAMON and counted in recoveries(); after
///   kMostRestarts in a row without a frame they become kDeviceFailed, which is final.
class V4l2Head final : public HeadPort {
 public:
  static constexpr int kMostRestarts = 5;

  /// `in_use` is set while this head owns the device: until the head is destroyed or its device is gone.
  V4l2Head(std::string path, std::shared_ptr<Channel> channel, Worker& worker, ClockPort& clock,
           std::shared_ptr<bool> in_use);
  ~V4l2Head() override;

  const HeadIdentity& identity() const override { return identity_; }
  const HeadFormat& format() const override { return channel_->granted.format; }
  const HeadLimits& limits() const override { return channel_->controls.limits(); }
  Status start(TriggerMode trigger) override;
  void stop() override;
  Status set_exposure(Exposure exposure) override;
  Status set_gain(Gain gain) override;
  Status set_white_balance(WhiteBalance balance) override;
  Status set_gamma(Gamma gamma) override;
  Status nudge(Duration by) override;
  Result<std::optional<FrameView>> take_frame() override;
  void add_wake_ups(WakeUps& to) const override;
  void release(BufferSlot slot) override;
  HeadRecoveries recoveries() const override { return recoveries_; }

 private:
  enum class State : std::uint8_t { kStopped, kStarting, kStreaming, kFailed };
  enum class Slot : std::uint8_t { kIdle, kQueued, kLent };
  struct Pending {
    Instant at;
    HeadSettings settings;
    int frames_left = 0;
  };

  Error error(Errc code, const std::string& sentence) const;
  Status bad_value(const std::string& what, const std::string& allowed) const;
  void post_controls(const ControlChange& change);
  void post_stream(bool again);
  void take_reports();
  void take_settings(const Channel::Report& report);
  void fail_for_good(Error why);
  void queue_idle();
  void restart();
  void watch_signal(Instant now);
  void release_to_driver(BufferSlot slot);
  FrameView stamped(const Stream::Frame& frame, Instant now);
  FrameView view(const Stream::Frame& frame, Instant now);
  std::optional<FrameView> weave(const Stream::Frame& frame, Instant now);

  const HeadIdentity identity_;
  std::shared_ptr<Channel> channel_;
  Worker& worker_;
  ClockPort& clock_;
  const std::shared_ptr<bool> in_use_;

  State state_ = State::kStopped;
  std::optional<Error> final_;  ///< the reason for kFailed
  std::uint64_t starts_ = 0;
  Instant started_;
  std::vector<Slot> slots_;                   ///< the driver's buffers
  std::optional<FieldWeaver> weaver_;         ///< where fields arrive by themselves; it owns the lent frames
  std::optional<Stream::Frame> first_field_;  ///< of the frame that the weaver has not finished
  int restarts_in_row_ = 0;
  HeadRecoveries recoveries_;
  HeadSettings settings_;
  std::deque<Pending> pending_;
  bool no_signal_ = false;
  bool signal_asked_ = false;
  Instant next_signal_;
};

}  // namespace nodal::hal::v4l2
