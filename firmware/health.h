// Says in one word and one sentence how the rig is, and tells the supervisor only of real progress.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/calibration_keeper.h"
#include "firmware/capture.h"
#include "firmware/config.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

/// What the rig's state is judged by.
struct Signs {
  const CaptureReport& capture;
  const KeeperReport& keeper;
  std::uint32_t rate_wanted_millihertz = 0;
  std::uint32_t rate_millihertz = 0;
  std::uint64_t unfit_frames = 0;
  Duration since_last_set;  ///< or since start
  Duration blending;        ///< without a pause or a change of calibration
};

struct Health {
  std::string state;    ///< "starting", "no-calibration", "idle", "running", "degraded"
  std::string problem;  ///< one sentence when the state is not "running"
};

/// The worst thing first: what keeps raymaps from coming, then what makes them worse than they should be.
Health assess(const RigConfig& config, const Signs& signs);

/// Feeds the watchdog while every stage either has nothing to do or gets on with it, so that a stage that hangs
/// has the daemon started again.
///
/// Threading: thread-bound to control.
/// Ownership: the port outlives it.
/// Errors: none.
class ProgressMonitor {
 public:
  static constexpr Duration kFeedEvery = Duration::milliseconds(500);
  static constexpr Duration kStuckAfter = Duration::seconds(5);

  explicit ProgressMonitor(hal::WatchdogPort* watchdog) : watchdog_(watchdog) {}

  struct Stage {
    std::string_view name;
    std::uint64_t progress = 0;  ///< anything that rises
    bool may_rest = false;       ///< it has nothing to do, or waits for somebody it should wait for
  };
  void step(const std::vector<Stage>& stages, const Health& health, Instant now);
  /// The stage that hangs, if one does.
  const std::optional<std::string>& stuck() const { return stuck_; }

 private:
  struct Seen {
    std::uint64_t progress = 0;
    Instant at;
  };
  hal::WatchdogPort* watchdog_;
  std::vector<Seen> seen_;
  std::optional<Instant> fed_;
  std::optional<std::string> stuck_;
  std::string told_;
};

}  // namespace nodal::firmware
