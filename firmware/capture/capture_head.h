#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "hal/head.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// What a host wants changed; what is not given stays.
struct SettingsChange {
  std::optional<Exposure> exposure;
  std::optional<Gain> gain;
  std::optional<WhiteBalance> white_balance;
  std::optional<hal::Gamma> gamma;

  /// What `newer` says goes over what this says.
  void add(const SettingsChange& newer);
};

/// frames = in_sets + held + sum of losses, always.
struct FrameCounts {
  std::uint64_t frames = 0;  ///< taken from the port
  std::uint64_t in_sets = 0;
  std::uint64_t held = 0;  ///< in a set that is still open
  std::array<std::uint64_t, kLossReasons> losses{};

  std::uint64_t lost() const;
  bool conserved() const { return frames == in_sets + held + lost(); }
  void add(const FrameCounts& other);
};

/// A head as status tells of it.
struct HeadReport {
  std::string path, model, serial;
  bool present = false;
  std::optional<hal::HeadFormat> format;  ///< as it last was
  std::optional<hal::HeadLimits> limits;
  hal::HeadSettings in_effect;  ///< of the newest frame
  FrameCounts counts;
  std::uint64_t missing_sets = 0;         ///< sets closed without it
  std::uint64_t opened = 0;               ///< times its port was opened
  hal::HeadRecoveries recoveries;         ///< of all its ports
  Duration skew;                          ///< of the newest frame after its set's middle
  std::optional<std::int32_t> drift_ppb;  ///< of its own clock, as it was last seen running free; positive is slow
  std::string problem;
  std::string ignores;  ///< a setting it was asked and does not carry out; empty: none
};

/// One head over all its comings and goings: opens its port by path, asks the settings of it again, counts its frames.
/// A port is never stopped or dropped while a frame of it is lent: the blend may be reading it.
///
/// Threading: thread-bound to capture.
/// Ownership: owns the port; the enumerator outlives it.
/// Errors: change() as HeadPort; everything else shows in report().problem.
class CaptureHead {
 public:
  CaptureHead(const HeadConfig& config, std::string path, hal::HeadEnumerator& enumerator);
  ~CaptureHead();

  /// Opens, closes and starts again, as is due. True when something changed.
  bool step(Instant now, hal::TriggerMode mode);
  /// The next frame if it is good. A bad one is counted under its reason and given back, and nothing is returned.
  std::optional<hal::FrameView> take_frame();

  /// What becomes of a frame that take_frame() gave, one of these two.
  void lose(const hal::FrameView& frame, LossReason reason);
  void hold(const hal::FrameView& frame);
  /// A held frame's set was closed; release() follows when nobody reads it any more.
  void put_in_set(Duration skew);
  void release(hal::BufferSlot slot);
  /// A set was closed without it.
  void missed_set();

  /// Checks a change against the head's limits, without making it. A head that is away takes anything.
  Status check(const SettingsChange& change) const;
  /// Asks it of the head; one that is away is asked when it returns.
  Status change(const SettingsChange& change);
  /// In free run, its exposures are moved in time; nothing when it does not stream.
  void nudge(Duration by);
  /// What it will expose with once it has carried out what it was asked; a head that does not, as it does now.
  Exposure exposure_to_come() const;

  /// While it waits to be started in another mode, frames of the old one are not taken.
  bool streaming() const { return port_ && started_ && !restarting_ && !gone_; }
  /// Sets wait for it: it delivers, or has not had the time to yet.
  bool expected() const { return streaming() && missed_in_row_ < kMissedUntilSilent; }
  /// Times it was started.
  std::uint64_t starts() const { return starts_; }
  const HeadReport& report() const { return report_; }
  void tell_drift(std::optional<std::int32_t> ppb) { report_.drift_ppb = ppb; }
  bool conserved() const;
  /// Gives up its port; every frame must have been released.
  void close();

 private:
  void open(Instant now);
  void start(hal::TriggerMode mode, Instant now);
  void vanish(const Error& why);
  Status ask(const SettingsChange& change);
  void watch_settings(const hal::HeadSettings& in_effect);

  static constexpr int kMissedUntilSilent = 3;
  static constexpr int kFramesOfGrace = 4;  ///< beyond the stated latency, until a setting counts as ignored

  const std::string name_;
  const std::string path_;
  hal::HeadEnumerator& enumerator_;
  SettingsChange wanted_;
  std::unique_ptr<hal::HeadPort> port_;
  bool started_ = false;
  bool restarting_ = false;
  bool gone_ = false;  ///< the port is dead and waits for its frames
  hal::TriggerMode mode_ = hal::TriggerMode::kFreeRun;
  std::optional<Instant> next_try_;
  std::uint64_t starts_ = 0;
  std::uint64_t lent_ = 0;
  std::uint64_t in_flight_ = 0;  ///< of them, those in sets that were closed
  int missed_in_row_ = 0;
  int frames_since_asked_ = 0;
  hal::HeadRecoveries recoveries_before_;  ///< of ports that were dropped
  HeadReport report_;
};

}  // namespace nodal::firmware
