// What heads on devices with slow calls have in common.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/device/channel.h"
#include "hal/linux/device/worker.h"

namespace nodal::hal::device {

/// Calls that may take seconds (start, stop, controls) run as jobs of the device's worker. take_frame() and release()
/// make only calls that never wait, and take the jobs' reports. So start() and set_…() return before the device acts:
/// take_frame() returns the error of a start that failed, and after a control that failed FrameView::in_effect is
/// unchanged.
///
/// A stream's buffers are the worker's while it starts, restarts or stops the stream, and the head's in between:
/// posting a job hands them over, and taking the job's report takes them back.
///
/// Threading: thread-bound to capture.
/// Ownership: refers to the worker and the clock. The destructor posts a job that ends the stream and closes the
/// device.
/// Errors: as HeadPort. A stream that fails is started again and counted in recoveries(); after kMaxRestarts in a row
///   without a frame the error becomes kDeviceFailed, which is final.
class DeviceHead : public HeadPort {
 public:
  static constexpr int kMaxRestarts = 5;

  /// `in_use` is set while this head owns the device: until the head is destroyed or its device is gone.
  DeviceHead(HeadIdentity identity, std::shared_ptr<Channel> channel, Worker& worker, ClockPort& clock,
             std::shared_ptr<bool> in_use);
  ~DeviceHead() override;

  const HeadIdentity& identity() const final { return identity_; }
  const HeadFormat& format() const final { return channel_->format(); }
  const HeadLimits& limits() const final { return channel_->limits(); }
  Status start(TriggerMode trigger) final;
  void stop() final;
  Status set_exposure(Exposure exposure) final;
  Status set_gain(Gain gain) final;
  Status set_white_balance(WhiteBalance balance) final;
  Status set_gamma(Gamma gamma) final;
  Status nudge(Duration by) final;
  HeadRecoveries recoveries() const final { return recoveries_; }

 protected:
  enum class State : std::uint8_t { kStopped, kStarting, kStreaming, kFailed };
  /// A job that starts a stream. It runs on the worker, so it may refer to the channel, but not to the head.
  using StreamJob = std::function<Status()>;

  /// The job that starts the stream; kUnsupported if the device has no such trigger.
  virtual Result<StreamJob> begin(TriggerMode trigger) = 0;
  /// The stream runs.
  virtual void on_stream_start() = 0;
  /// The stream was stopped: no buffer is lent any more.
  virtual void stopped() = 0;

  Error error(Errc code, const std::string& sentence) const;
  State state() const { return state_; }
  /// Why it failed; only in kFailed.
  const Error& why() const { return *final_; }
  ClockPort& clock() const { return clock_; }
  Worker& worker() const { return worker_; }
  HeadRecoveries& counts() { return recoveries_; }

  void take_reports();
  void fail_for_good(Error why);
  /// Posts the job that starts a broken stream again; with too many in a row the head fails.
  void restart(StreamJob job);
  /// A frame arrived: the stream works.
  void frame_is_good() { restarts_in_row_ = 0; }
  /// The settings of the frame whose exposure begins at begin_with(exposure). A change applies to frames that begin
  /// after it, plus the control latency; to every frame of a stream that was started after it.
  const HeadSettings& settings_of(const std::function<Instant(Exposure)>& begin_with);
  /// Adds the wake-up for reports. Without descriptors for reports the caller looks for them at its own interval.
  void add_report_wake_up(WakeUps& to) const { to.on({channel_->reported, true, false}); }

 private:
  struct Pending {
    Instant at;
    HeadSettings settings;
    int frames_left = 0;
  };

  Status bad_value(const std::string& what, const std::string& allowed) const;
  void post_controls(const ControlChange& change);
  void post_stream(StreamJob job);
  void take_settings(const Channel::Report& report);

  const HeadIdentity identity_;
  std::shared_ptr<Channel> channel_;
  Worker& worker_;
  ClockPort& clock_;
  const std::shared_ptr<bool> in_use_;

  State state_ = State::kStopped;
  std::optional<Error> final_;  ///< the reason for kFailed
  std::uint64_t starts_ = 0;
  Instant started_;
  int restarts_in_row_ = 0;
  HeadRecoveries recoveries_;
  HeadSettings settings_;
  std::deque<Pending> pending_;
};

}  // namespace nodal::hal::device
