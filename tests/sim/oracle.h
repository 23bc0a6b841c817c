// The rules that must hold after every event, checked against the truth, never against the rig's own reports alone.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "firmware/rig.h"
#include "tests/sim/hostile.h"
#include "tests/sim/world.h"

namespace nodal::swarm {

/// The slowest recoveries, in time and in periods of the rig; the two may be from different runs.
struct Recovery {
  std::int64_t ns = 0, periods = 0;
};

/// Statistics, summed over seeds.
struct Tally {
  std::uint64_t events = 0, frames = 0, sets = 0, full_sets = 0, locked_sets = 0, raymaps = 0, kills = 0, replies = 0;
  std::uint64_t episodes = 0, storms = 0, uploads = 0;
  std::uint64_t never_came = 0;               ///< frames that were exposed and lost before the rig could take them
  std::int64_t worst_locked_spread_ns = 0;    ///< true spread of the begins, for aligned rigs of the middles
  Recovery slowest_replug, slowest_recovery;  ///< until sets are whole again
  std::int64_t slowest_full_replug = 0, slowest_full_recovery = 0;  ///< until every head is in the sets again, ns
  std::int64_t slowest_alignment = 0;                               ///< periods until heads are aligned after faults
  std::uint64_t watched = 0,
                not_following = 0;  ///< wired heads in steps of the rig: all, those reported to drift or skip
  std::uint64_t aligned_sets = 0;   ///< the locked sets without a trigger
  std::array<std::array<std::array<std::uint64_t, kHowMany>, kHeadFaults>, kHeadStates> visited{};
  std::array<std::uint64_t, kRigFaults> rig_faults{};
  std::array<std::uint64_t, firmware::kLossReasons> losses{};
  // Episodes with hostile clients, and the good clients in them.
  std::uint64_t crowds = 0;                            ///< number of such episodes
  std::array<std::uint64_t, kHostileKinds> hostile{};  ///< number of clients
  std::uint64_t good_answers = 0;                      ///< answered requests and delivered raymaps
  std::uint64_t good_refused = 0, good_dropped = 0;    ///< requests and connections before a retry
  std::int64_t slowest_good = 0;                       ///< ns from the first attempt to the result
  std::uint64_t most_live = 0, most_left = 0;          ///< additional live bytes during and after them
  void add(const Tally& other);
};

/// Threading: thread-bound.
/// Ownership: refers to the world and the tally.
/// Errors: failure() holds the first; nothing is checked after it.
class Oracle {
 public:
  Oracle(World& world, const Nature& nature, Tally& tally);

  /// A process was started: its counters begin at zero.
  void new_process();
  /// A set left capture. `held_up`: frames or the rig were delayed, so it may be old.
  void on_set(const firmware::FrameSet& set, bool held_up);
  /// The rig was stepped; `captured` is the time of capture's step, if there was one.
  void after_event(firmware::Rig& rig, std::optional<Instant> captured);
  /// A host received a raymap.
  void on_raymap(const wire::RaymapHeader& header, const std::vector<std::uint8_t>& pixels,
                 const std::array<Sha256, kCalibrations>& ids);

  const std::optional<std::string>& failure() const { return failure_; }
  void fail(const std::string& what);
  std::uint64_t trace() const { return trace_; }
  void trace(std::uint64_t what) { trace_ = (trace_ ^ what) * 0x100000001B3ULL + (trace_ >> 47); }

  // For recovery. A full set has every head; a whole set is also locked, if the trigger runs.
  void begin_to_watch();
  std::optional<Instant> first_full() const { return first_full_; }
  /// All sets since then are full.
  std::optional<Instant> full_since() const { return full_since_; }
  std::optional<Instant> first_whole() const { return first_whole_; }
  /// All sets since then are whole.
  std::optional<Instant> whole_since() const { return whole_since_; }
  std::uint64_t sets_since() const { return sets_; }
  std::uint64_t whole_sets_since() const { return whole_sets_; }
  /// For an aligned rig: the first full set that was locked.
  std::optional<Instant> first_in_step() const { return first_in_step_; }
  bool genlock_is_off() const { return genlock_ == firmware::GenlockState::kOff; }

 private:
  struct Remembered {
    firmware::HeadMask decodable = 0;  ///< its heads whose pictures are whole
    std::optional<std::uint64_t> trigger;
    Instant mid;
    std::optional<int> made_by;  ///< the calibration, once a raymap has arrived
    bool exposed_alike = false;  ///< the tone is neutral, so a raymap's levels depend on the calibration only
  };
  bool exposed_alike(const firmware::FrameSet& set);
  Duration period() const;
  void check_members(const firmware::FrameSet& set);
  /// For a raymap: its reported field, according to the heads' fields, and the time of that field's exposure.
  void check_field(const wire::RaymapHeader& header, Instant set_mid);
  /// A wired head may be reported as not following only if it did not follow.
  void check_wired(const firmware::GenlockReport& genlock);
  void check_locked(const firmware::FrameSet& set);
  void check_books(firmware::Rig& rig);
  void check_genlock(firmware::Rig& rig, std::optional<Instant> captured);

  World& world_;
  const Nature& nature_;
  Tally& tally_;
  std::optional<std::string> failure_;
  std::uint64_t trace_ = 0xcbf29ce484222325ULL;

  std::vector<std::uint64_t> taken_before_;  ///< by the head's counter, at the start of this process
  std::vector<int> followed_;                ///< successive exposures of each head that successive pulses started
  std::vector<std::uint64_t> last_pulse_;    ///< number of the pulse that exposed each head's newest frame in a set
  std::vector<std::uint64_t> last_serial_;   ///< serial number of each head's newest frame in a set
  std::array<std::optional<Stamp>, kMaxHeads> stamps_;  ///< timestamps of the present set
  std::optional<std::uint64_t> last_set_;
  std::uint64_t not_taken_ = 0;
  std::optional<PulseId> last_trigger_;
  firmware::GenlockState genlock_ = firmware::GenlockState::kOff;
  Instant genlock_started_;
  std::map<std::uint64_t, Remembered> remembered_;
  std::optional<hal::HeadSettings> first_exposed_;  ///< settings of the first frame of this process
  bool ever_exposed_apart_ = false;
  std::optional<Instant> first_full_, full_since_, first_whole_, whole_since_, first_in_step_;
  Instant last_set_at_;
  std::uint64_t sets_made_ = 0;
  std::uint64_t sets_ = 0, whole_sets_ = 0;
  firmware::FrameCounts counts_;  ///< frame counts of this process
};

}  // namespace nodal::swarm
