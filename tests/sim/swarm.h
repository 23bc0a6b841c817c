// One seed, from its first to its last event: a whole rig, its world, its hosts, and all faults.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/rig.h"
#include "hal/sim/disk.h"
#include "hal/sim/link.h"
#include "hal/sim/watchdog.h"
#include "tests/sim/crowd.h"
#include "tests/sim/host.h"
#include "tests/sim/oracle.h"
#include "tests/sim/world.h"

namespace nodal::swarm {

struct Outcome {
  std::optional<std::string> failure;  ///< with time and state
  std::uint64_t trace = 0;
  Tally tally;
};

/// Runs episodes one after another. Each has: a state of some heads, a fault, the end of all faults, and a recovery
/// whose time is measured. Everything is drawn from the seed and run by the queue; the rig is stepped when a device has
/// data for it, and every few milliseconds.
///
/// Threading: thread-bound, and starts no thread.
/// Ownership: owns the world and the rig.
/// Errors: in the outcome.
class Swarm {
 public:
  Swarm(std::uint64_t seed, const DrawOptions& options);
  ~Swarm();

  Outcome run(Duration how_long);

  static constexpr Duration kWithinReplug = Duration::seconds(2);
  static constexpr Duration kWithinFaults = Duration::seconds(3);
  /// For locked sets the limit in periods; the longer one applies: with 0.2 ms of timestamp jitter it takes 16
  /// exposures to confirm that heads are within 0.5 ms, and at 5 frames per second these alone take more than 3 s.
  static constexpr std::int64_t kPeriodsWithinReplug = 12, kPeriodsWithinFaults = 24;
  /// Without a trigger: the limit for heads with any phases to be in step again.
  static constexpr std::int64_t kPeriodsToAlign = 90;

 private:
  enum class Phase : std::uint8_t { kCalm, kPrepared, kFaulty, kRecovering };
  struct Episode {
    bool of_clients = false;  ///< with hostile clients
    bool of_heads = true;
    HeadFault head_fault = HeadFault::kLose;
    RigFault rig_fault = RigFault::kStorm;
    HeadState state = HeadState::kFree;
    HowMany many = HowMany::kOne;
    std::vector<std::size_t> heads;
  };

  void handle(const Event& event);
  // Steps of the rig.
  void plan_step(Instant at);
  void step(Instant now);
  void look_at_set();
  bool held_up() const;
  void step_rest(Instant now);
  void start_process();
  void end_process(bool power_lost);
  // Hosts.
  Host& host();
  void act_hosts();
  // Episodes.
  void plan_next(Duration after);
  void advance_episode();
  void draw_episode();
  void prepare();
  HeadState state_of(std::size_t head);
  void begin_head_fault();
  void begin_rig_fault();
  void begin_link_fault();
  void begin_storm();
  void begin_crowd();
  void step_clock(Duration by);
  void end_faults();
  void check_recovery();
  void check_alignment();
  Duration drawn(Duration least, Duration most);
  Duration periods(std::int64_t n) const { return nature_.rate.period() * n; }
  std::string where() const;

  const DrawOptions options_;
  const Nature nature_;
  hal::sim::Random random_;
  World world_;
  Outcome outcome_;
  Oracle oracle_;
  Documents documents_;
  const firmware::RigConfig config_;
  std::unique_ptr<hal::sim::SimDisk> disk_;
  std::unique_ptr<hal::sim::SimLinkListener> listener_;
  std::unique_ptr<hal::sim::SimWatchdog> watchdog_;
  std::unique_ptr<firmware::Rig> rig_;
  std::unique_ptr<SecondReader> reader_;
  std::vector<std::unique_ptr<Host>> hosts_;
  std::uint64_t hosts_made_ = 0;
  hal::sim::Random wiring_;       ///< faults of wired heads
  hal::sim::Random crowds_;       ///< the time and parameters of crowds
  std::unique_ptr<Crowd> crowd_;  ///< during an episode

  Instant end_, next_step_, next_look_;
  std::optional<std::uint64_t> looked_at_;
  Instant capture_until_, blend_until_, keeper_until_, control_until_;  ///< stages that are delayed

  Phase phase_ = Phase::kCalm;
  Episode episode_;
  Instant faults_ended_;
  Duration recover_within_;
  bool replugged_ = false;  ///< and no other fault
  bool genlocked_ = false;
};

}  // namespace nodal::swarm
