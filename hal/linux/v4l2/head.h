// A V4L2 capture device as a head.
#pragma once

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
#include "hal/linux/v4l2/negotiation.h"
#include "hal/linux/v4l2/stream.h"
#include "hal/linux/v4l2/worker.h"

namespace nodal::hal::v4l2 {

/// A device that is open and set up, shared by the head and the jobs that its worker still has.
struct Channel {
  Channel(std::unique_ptr<Device> opened, const HeadRequest& asked, Granted given, Controls found, HeadSettings now)
      : device(std::move(opened)),
        request(asked),
        granted(std::move(given)),
        controls(std::move(found)),
        settings(now),
        stream(*device, granted) {}

  const std::unique_ptr<Device> device;
  const HeadRequest request;
  const Granted granted;
  const Controls controls;
  const HeadSettings settings;  ///< when it was opened
  /// The worker's from the moment that a job for it is posted until the job's report was taken, else the head's.
  Stream stream;

  /// What a job of the worker has to say.
  struct Report {
    enum class About : std::uint8_t { kStream, kControls, kSignal } about = About::kStream;
    std::uint64_t start = 0;  ///< kStream: which start it was
    Instant at;               ///< when the calls had returned
    std::optional<Error> error;
    HeadSettings settings;   ///< kControls
    bool no_signal = false;  ///< kSignal
  };
  std::mutex mutex;              ///< of what follows
  std::vector<Report> reports;   ///< to the head
  ControlChange wanted;          ///< to the worker: what is to be set, newer values over older ones
  bool controls_posted = false;  ///< a job that takes `wanted` is on its way
};

/// Calls that may take seconds (starting, stopping, controls, asking for the signal) are jobs of the device's worker;
/// take_frame() and release() make only calls that never wait (VIDIOC_DQBUF of a non-blocking descriptor, VIDIOC_QBUF)
/// and take what jobs have reported. start() and set_…() therefore return before the device has done anything: a start
/// that fails is an error of take_frame(), and a control that fails leaves FrameView::in_effect as it was.
///
/// Threading: thread-bound to capture.
/// Ownership: the worker and the clock outlive it. Destroying it posts the device's closing to the worker.
/// Errors: as HeadPort. Errors of the stream are recovered by VIDIOC_STREAMOFF and STREAMON and counted in recoveries();
///   after kMostRestarts in a row without a frame they are kDeviceFailed, and final.
class V4l2Head final : public HeadPort {
 public:
  static constexpr int kMostRestarts = 5;

  /// `in_use` is set while the device is this head's: until it is destroyed or its device is gone.
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
  FrameView view(const Stream::Frame& frame, Instant now);

  const HeadIdentity identity_;
  std::shared_ptr<Channel> channel_;
  Worker& worker_;
  ClockPort& clock_;
  const std::shared_ptr<bool> in_use_;

  State state_ = State::kStopped;
  std::optional<Error> final_;  ///< why it is kFailed
  std::uint64_t starts_ = 0;
  Instant started_;
  std::vector<Slot> slots_;
  int restarts_in_row_ = 0;
  HeadRecoveries recoveries_;
  HeadSettings settings_;
  std::deque<Pending> pending_;
  bool no_signal_ = false;
  bool signal_asked_ = false;
  Instant next_signal_;
};

}  // namespace nodal::hal::v4l2
