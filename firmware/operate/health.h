// The supervisor: what state the rig is in and why, in one table; it tells systemd only of real progress.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/operate/shedding.h"
#include "hal/watchdog.h"

namespace nodal::firmware {

enum class RigState : std::uint8_t { kStarting, kNoCalibration, kIdle, kRunning, kDegraded, kHanging, kStopping };
inline constexpr std::size_t kRigStates = 7;
/// "starting", "no-calibration", …: as the wire, the log and the panel have it.
std::string_view rig_state_name(RigState state);

/// What may be so, worst first: the first that holds decides. kWell always holds.
enum class Condition : std::uint8_t {
  kEnding,         ///< somebody asked the rig to stop
  kStageHangs,     ///< a stage has something to do and does not get on with it
  kStoreUnread,    ///< calibrations are being read
  kNoCalibration,  ///< none is in force
  kNoFrames,       ///< no set for a while
  kHeadAway,
  kGenlockLost,
  kHoldover,
  kUnfitFrames,  ///< not what the calibration is for
  kStoreTrouble,
  kHeadTrouble,
  kTooSlow,  ///< fewer raymaps than frames, or some of the work is shed
  kWell,
};
inline constexpr std::size_t kConditions = 13;

/// What a transition does.
struct Acts {
  bool ready = false;  ///< systemd is told so, once: the store has been read
  bool feed = false;   ///< its watchdog is fed; else it starts the daemon again after a while
  bool end = false;    ///< hosts are told why, none is let in, lamps go dark
};
struct Transition {
  RigState to = RigState::kStarting;
  Acts acts;
};
/// The whole table.
Transition transition(Condition worst, RigState from);

/// What the rig's state is judged by.
struct Signs {
  const CaptureReport& capture;
  const KeeperReport& keeper;
  std::uint32_t rate_wanted_millihertz = 0;
  std::uint32_t rate_millihertz = 0;
  std::uint64_t unfit_frames = 0;
  Duration since_last_set;  ///< or since start
  Duration blending;        ///< without a pause or a change of calibration
  ShedLevel shed;
  const std::string& settings_problem;  ///< SettingsWriter::problem()
};

/// The first condition that holds of those from kStoreUnread on, and a sentence about it; empty for kWell.
struct Finding {
  Condition condition = Condition::kWell;
  std::string sentence;
};
Finding find_condition(const RigConfig& config, const Signs& signs);

struct Health {
  std::string_view state = "starting";                    ///< rig_state_name()
  std::string problem = "reading the calibration store";  ///< one sentence when the state is not "running"
};

/// Goes through the table every kFeedEvery: a stage that hangs starves the watchdog, so that the daemon is started
/// again; one that gets on again is forgiven. The first reason to end is the one that is told, and nothing undoes it.
///
/// Threading: thread-bound to control.
/// Ownership: the port outlives it.
/// Errors: none.
class Supervisor {
 public:
  static constexpr Duration kFeedEvery = Duration::milliseconds(500);
  static constexpr Duration kStuckAfter = Duration::seconds(5);

  explicit Supervisor(hal::WatchdogPort* watchdog) : watchdog_(watchdog) {}

  struct Stage {
    std::string_view name;
    std::uint64_t progress = 0;  ///< anything that rises
    bool may_rest = false;       ///< it has nothing to do, or waits for somebody it should wait for
  };
  void step(const std::vector<Stage>& stages, const Finding& found, Instant now);
  /// The rig stops, for this reason; later ones are not listened to.
  void end(std::string reason);

  const Health& health() const { return health_; }
  RigState state() const { return state_; }
  /// What the last transition asks for.
  const Acts& acts() const { return acts_; }

 private:
  std::optional<std::string_view> find_stuck(const std::vector<Stage>& stages, Instant now);
  void tell(const Acts& acts, Instant now);

  struct Seen {
    std::uint64_t progress = 0;
    Instant at;
  };
  hal::WatchdogPort* watchdog_;
  std::vector<Seen> seen_;
  std::optional<std::string> ending_;  ///< why
  RigState state_ = RigState::kStarting;
  Acts acts_;
  Health health_;
  bool told_ready_ = false;
  bool told_end_ = false;
  std::optional<Instant> fed_;
  std::string told_;
};

}  // namespace nodal::firmware
