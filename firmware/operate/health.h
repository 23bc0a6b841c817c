// The supervisor: determines the rig's state and its reason by one table, and feeds systemd's watchdog while stages
// work.
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
#include "firmware/picture/blender.h"
#include "firmware/record/take_messages.h"
#include "hal/heartbeats.h"
#include "hal/watchdog.h"
#include "protocol/base/frame_time.h"

namespace nodal::firmware {

enum class RigState : std::uint8_t { kStarting, kNoCalibration, kIdle, kRunning, kDegraded, kHanging, kStopping };
inline constexpr std::size_t kRigStates = 7;
/// "starting", "no-calibration", …: the name in the protocol, in the log and for the panel.
std::string_view rig_state_name(RigState state);

/// Conditions of the rig, worst first: the first that holds determines the state. kHealthy always holds.
enum class Condition : std::uint8_t {
  kEnding,         ///< the rig was asked to stop
  kStageHangs,     ///< a stage has work and makes no progress
  kStoreUnread,    ///< calibrations are being read
  kNoCalibration,  ///< no calibration is in force
  kNoFrames,       ///< no set for kSilence
  kDiskSilent,     ///< the disk of the takes does not answer
  kHeadMissing,
  kGenlockLost,
  kHoldover,
  kUnfitFrames,  ///< frames have a format that the calibration is not for
  kStoreTrouble,
  kHeadTrouble,
  kTakeTrouble,   ///< the disk loses something of the take, or ended it
  kThreadSilent,  ///< another thread is at one piece of work for too long
  kTooSlow,       ///< fewer raymaps than frame sets, or some of the work is shed
  kHealthy,
};
inline constexpr std::size_t kConditions = 16;

/// The actions of a transition.
struct Actions {
  bool ready = false;  ///< notify systemd once that the store has been read
  bool feed = false;   ///< feed systemd's watchdog, which otherwise restarts the daemon
  bool end = false;    ///< send hosts the reason, accept no more hosts, switch lamps off
};
struct Transition {
  RigState to = RigState::kStarting;
  Actions actions;
};
/// The whole table of transitions.
Transition transition(Condition worst, RigState from);

/// The measurements that determine the rig's condition.
struct HealthInputs {
  const CaptureReport& capture;
  const KeeperReport& keeper;
  std::uint32_t rate_wanted_millihertz = 0;
  std::uint32_t rate_millihertz = 0;
  std::uint64_t unfit_frames = 0;
  Duration since_last_set;  ///< since the start, before the first set
  Duration blending;        ///< time without a pause of the sets or a change of calibration
  ShedLevel shed;
  const std::string& settings_problem;  ///< SettingsWriter::problem(), or AuditLog::problem()
  const TakeReport* takes;              ///< null: the rig records nothing
  Duration since_lost_set;  ///< time since the disk was too slow for a set of the take; 1 000 000 s: it never was
  const std::vector<hal::Heartbeat>& threads;
  const std::string& undecodable;  ///< a sentence about a head whose newest frame could not be decoded, or empty
};

/// Half a sentence about the head's newest frame, if it could not be decoded: "its pictures ..."; otherwise empty.
std::string undecodable_now(const Blender& blender, std::size_t head);

/// The worst condition from kStoreUnread to kHealthy, and a sentence about it, which is empty for kHealthy.
struct Diagnosis {
  Condition condition = Condition::kHealthy;
  std::string sentence;
};
Diagnosis diagnose(const RigConfig& config, const HealthInputs& inputs);

/// Without a frame set for this long, the rig counts as without frames. A set that waits for a head that has just
/// fallen silent closes 2.5 periods late.
inline constexpr FrameTime kSilence{Duration::milliseconds(1500), 4};
/// "no frames arrive", and the missing heads or what is wrong with the first head that has a problem.
std::string no_frames(const RigConfig& config, const CaptureReport& capture);

/// Whether the disk of the takes does not answer: a thread of it is at one call for over kDiskAnswersWithin.
bool disk_is_silent(const std::vector<hal::Heartbeat>& threads);
inline constexpr Duration kDiskAnswersWithin = Duration::seconds(5);

struct Health {
  std::string_view state = "starting";                    ///< rig_state_name()
  std::string problem = "reading the calibration store";  ///< one sentence when the state is not "running"
};

/// Applies the table in every step and feeds the watchdog every kFeedEvery. While a stage hangs the watchdog is not
/// fed, so that systemd restarts the daemon unless the stage continues in time. The first reason to end is kept and
/// reported.
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
    std::uint64_t progress = 0;  ///< a number that rises with the stage's work
    bool may_idle = false;       ///< it has no work, or waits for another stage as it should
  };
  void step(const std::vector<Stage>& stages, const Diagnosis& found, Instant now);
  /// The rig stops, for this reason. Only the first call has an effect.
  void end(std::string reason);

  const Health& health() const { return health_; }
  RigState state() const { return state_; }
  /// The actions of the last transition.
  const Actions& actions() const { return actions_; }

 private:
  std::optional<std::string_view> find_stuck(const std::vector<Stage>& stages, Instant now);
  void notify(const Actions& actions, Instant now);

  struct Seen {
    std::uint64_t progress = 0;
    Instant at;
  };
  hal::WatchdogPort* watchdog_;
  std::vector<Seen> seen_;
  std::optional<std::string> ending_;  ///< reason of the end
  RigState state_ = RigState::kStarting;
  Actions actions_;
  Health health_;
  bool ready_sent_ = false;
  bool stopping_sent_ = false;
  std::optional<Instant> fed_;
  std::string status_sent_;
};

}  // namespace nodal::firmware
