// Assesses the rig's state, says what changes, and sheds work.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/statistics.h"
#include "firmware/operate/health.h"
#include "firmware/operate/news.h"
#include "firmware/operate/shedding.h"
#include "firmware/operate/stages.h"
#include "hal/heartbeats.h"
#include "hal/watchdog.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Threading: thread-bound to control.
/// Ownership: all that it is made with outlives it.
/// Errors: none.
class RigWatch {
 public:
  RigWatch(const RigConfig& config, const Stages& stages, News& news, hal::WatchdogPort* watchdog, Instant now);

  struct Input {
    const Reports& reports;
    const std::string& store_problem;         ///< what is wrong with the stores of settings and of the audit log
    bool lossless = false;                    ///< a client pulls without loss, so no raymap may be shed
    const std::string* end_reason = nullptr;  ///< the rig was asked to end; null: it was not
  };
  void step(const Input& input, Instant now);

  const Health& health() const { return supervisor_.health(); }
  /// The supervisor has started the end.
  bool ends() const { return supervisor_.actions().end; }
  std::uint32_t rate_millihertz() const { return rate_.millihertz(); }  ///< measured rate of raymaps
  std::uint32_t rate_wanted_millihertz(const CaptureReport& capture) const;
  /// Frame sets that the blend missed because its queue was full.
  static std::uint64_t sets_missed_by_blend(const CaptureReport& capture);

  /// A start counts as good after this time without a hanging stage: twice the time until a hanging stage is detected.
  static constexpr Duration kStableAfter = Supervisor::kStuckAfter * 2;

 private:
  void assess(const Input& input, Instant now);
  Diagnosis diagnosis(const Input& input, Instant now);
  void shed(const Input& input, Instant now);
  void watch_frames(const CaptureReport& capture, Condition condition, Instant now);
  void watch_disk();
  void watch_seams();
  void watch_stability(Instant now);

  const RigConfig& config_;
  const Stages stages_;
  News& news_;
  Supervisor supervisor_;
  Shedding shedding_;
  RecentRate rate_;
  std::uint64_t sets_seen_ = 0;
  Instant newest_set_;
  std::uint64_t sets_lost_by_disk_ = 0;  ///< sets of the current take that were lost because the disk was too slow
  std::optional<Instant> newest_lost_set_;
  bool seams_refused_told_ = false;
  bool frames_arrive_ = true;  ///< what watch_frames() logged last
  std::vector<hal::Heartbeat> threads_;
  bool disk_silent_ = false;   ///< what watch_disk() logged last
  std::uint64_t adopted_ = 0;  ///< calibrations and seams that the blend had adopted at the newest assessment
  Instant steady_since_;       ///< end of the last pause of the sets, or the last adoption
  std::optional<Instant> judged_;
  std::optional<Sha256> judged_with_;  ///< the calibration that was in force then
  Instant unstable_;                   ///< the last time the rig was starting or hanging
  bool stable_noted_ = false;          ///< by the settings' store
};

}  // namespace nodal::firmware
