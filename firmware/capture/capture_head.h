#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "hal/head.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// A change of some settings of a head; an empty field is not changed.
struct SettingsChange {
  std::optional<Exposure> exposure;
  std::optional<Gain> gain;
  std::optional<WhiteBalance> white_balance;
  std::optional<hal::Gamma> gamma;

  /// Fields that `newer` has replace this one's.
  void add(const SettingsChange& newer);
  /// Fields that `other` has become empty.
  void remove(const SettingsChange& other);
  bool empty() const { return !exposure && !gain && !white_balance && !gamma; }
};

/// Invariant: frames = in_sets + held + sum of losses.
struct FrameCounts {
  std::uint64_t frames = 0;  ///< taken from the port
  std::uint64_t in_sets = 0;
  std::uint64_t held = 0;  ///< frames in sets that are still open
  std::array<std::uint64_t, kLossReasons> losses{};

  std::uint64_t lost() const;
  bool conserved() const { return frames == in_sets + held + lost(); }
  void add(const FrameCounts& other);
};

/// Status of a head.
struct HeadReport {
  std::string path, model, serial;
  bool present = false;
  std::optional<hal::TriggerMode> started_by;  ///< what starts its exposures; empty: it does not stream
  std::optional<hal::HeadFormat> format;       ///< the newest known one; empty: never opened
  std::optional<hal::HeadLimits> limits;
  hal::HeadSettings in_effect;  ///< settings of the newest frame
  FrameCounts counts;
  std::uint64_t missing_sets = 0;         ///< sets that were closed without a frame of this head
  bool in_no_set = false;                 ///< it streams, and no set of the last kInNoSet has a frame of it
  std::optional<LossReason> newest_loss;  ///< reason of the newest loss since its newest frame in a set; empty: none
  std::uint64_t opened = 0;               ///< how often its port was opened
  hal::HeadRecoveries recoveries;         ///< sum over all ports that it has had
  Duration skew;                          ///< mid-exposure of the newest frame minus that of its set
  std::optional<std::int32_t> drift_ppb;  ///< drift of its own clock, measured when it last ran free; positive is slow
  std::string problem;
  std::string ignores;  ///< a sentence about a requested setting that it does not apply; empty: none
};

/// One head, also while it is disconnected: opens its port by path, requests its settings again after a reconnect,
/// counts its frames. A port is never stopped or destroyed while a frame of it is lent, because the blend may be
/// reading it.
///
/// Threading: thread-bound to capture.
/// Ownership: owns the port; the enumerator outlives it.
/// Errors: change() returns HeadPort's errors; all others are in report().problem.
class CaptureHead {
 public:
  CaptureHead(const HeadConfig& config, std::string path, hal::HeadEnumerator& enumerator);
  ~CaptureHead();

  /// Opens, closes or restarts the port if necessary. True when something changed. A wired head is in wired mode
  /// whatever `mode` is, so it streams on when the genlock starts or stops.
  bool step(Instant now, hal::TriggerMode mode);
  /// The next frame if it is good. A bad frame is counted under its reason and released, and nothing is returned.
  std::optional<hal::FrameView> take_frame();

  /// Adds what wakes capture for this head, after step() and take_frame() did nothing.
  void add_wake_ups(hal::WakeUps& to) const;

  /// The caller passes every frame from take_frame() to one of these two.
  void lose(const hal::FrameView& frame, LossReason reason);
  void hold(const hal::FrameView& frame);
  /// A held frame's set was closed; release() follows when the last reader has released the set.
  void put_in_set(Duration skew);
  void release(hal::BufferSlot slot);
  /// A set was closed without a frame of this head. `period`: of the frame rate in force.
  void missed_set(Duration period);

  /// Checks a change against the head's limits without requesting it. A disconnected head has no limits.
  Status check(const SettingsChange& change) const;
  /// Requests a change from the head. A disconnected head gets it when it returns. A change with a lease is temporary:
  /// end_lease() undoes it, unless a change without one has replaced it.
  Status change(const SettingsChange& change, std::uint64_t lease = 0);
  /// Errors: kBusy when the head has temporary settings of another lease.
  Status check_lease(std::uint64_t lease) const;
  /// Restores what the temporary settings of this lease changed. Without effect if it has none.
  Status end_lease(std::uint64_t lease);
  /// Shifts its exposures in time, in free run; does nothing when the head does not stream.
  void nudge(Duration by);
  /// The requested exposure while the head may still apply it; after that, or without a request, the one in effect.
  Exposure pending_exposure() const;

  /// False while it waits for a restart in another mode: frames of the old mode are not taken.
  bool streaming() const { return port_ && started_ && !restarting_ && !gone_; }
  /// Whether open sets wait for a frame of it: it streams and has not missed kMissedUntilSilent sets in a row.
  bool expected() const { return streaming() && missed_in_row_ < kMissedUntilSilent; }
  /// How often it was started.
  std::uint64_t starts() const { return starts_; }
  const HeadReport& report() const { return report_; }
  /// So many sets in a row without a frame of a streaming head, or more, are HeadReport::in_no_set.
  static constexpr FrameTime kInNoSet{Duration::seconds(2), 4};
  void set_drift(std::optional<std::int32_t> ppb) { report_.drift_ppb = ppb; }
  bool conserved() const;
  /// Stops and destroys its port; every frame must have been released.
  void close();

 private:
  /// The requested settings: those to keep, and the temporary ones above them.
  SettingsChange wanted() const;
  SettingsChange before(const SettingsChange& change) const;
  void open(Instant now);
  void start(hal::TriggerMode mode, Instant now);
  void vanish(const Error& why);
  Status request(const SettingsChange& change);
  void back_in_sets();
  void watch_settings(const hal::HeadSettings& in_effect);

  static constexpr int kMissedUntilSilent = 3;
  static constexpr int kFramesOfGrace = 4;  ///< frames beyond the stated latency until a setting counts as ignored

  const std::string name_;
  const std::string path_;
  const bool wired_;
  hal::HeadEnumerator& enumerator_;
  SettingsChange wanted_;  ///< without the temporary ones
  struct Temporary {
    std::uint64_t lease = 0;
    SettingsChange change, before;
  };
  std::optional<Temporary> temporary_;
  std::unique_ptr<hal::HeadPort> port_;
  bool started_ = false;
  bool restarting_ = false;
  bool gone_ = false;  ///< the device is gone; the port is destroyed when all its frames are released
  hal::TriggerMode mode_ = hal::TriggerMode::kFreeRun;
  std::optional<Instant> next_try_;
  std::uint64_t starts_ = 0;
  std::uint64_t lent_ = 0;
  std::uint64_t in_flight_ = 0;  ///< lent frames that are in closed sets
  int missed_in_row_ = 0;        ///< sets since the last frame, good or bad
  int sets_without_it_ = 0;      ///< sets since the last one that has a frame of it, or since its start
  int frames_since_request_ = 0;
  hal::HeadRecoveries recoveries_before_;  ///< recoveries of the ports that were destroyed
  HeadReport report_;
};

}  // namespace nodal::firmware
