// What must hold after every event, judged by the truth and by nothing the rig says of itself alone.
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

/// The slowest of recoveries, in time and in periods of its rig; each may be of another.
struct Recovery {
  std::int64_t ns = 0, periods = 0;
};

/// What was seen, added up over seeds.
struct Tally {
  std::uint64_t events = 0, frames = 0, sets = 0, full_sets = 0, locked_sets = 0, raymaps = 0, kills = 0, replies = 0;
  std::uint64_t episodes = 0, storms = 0, uploads = 0;
  std::uint64_t never_came = 0;               ///< frames that were exposed and lost before the rig could take them
  std::int64_t worst_locked_spread_ns = 0;    ///< begins, of aligned rigs middles, in truth
  Recovery slowest_replug, slowest_recovery;  ///< whole again
  std::int64_t slowest_full_replug = 0, slowest_full_recovery = 0;  ///< every head in the sets again, ns
  std::int64_t slowest_alignment = 0;                               ///< in periods, after faults
  std::uint64_t aligned_sets = 0;                                   ///< of the locked ones, those without a trigger
  std::array<std::array<std::array<std::uint64_t, kHowMany>, kHeadFaults>, kHeadStates> visited{};
  std::array<std::uint64_t, kRigFaults> rig_faults{};
  std::array<std::uint64_t, firmware::kLossReasons> losses{};
  // Of hostile clients, and of good ones beside them.
  std::uint64_t crowds = 0;                            ///< episodes of them
  std::array<std::uint64_t, kHostileKinds> hostile{};  ///< how many there were
  std::uint64_t good_answers = 0;                      ///< requests answered and raymaps given
  std::uint64_t good_refused = 0, good_dropped = 0;    ///< requests, and connections, before they were tried again
  std::int64_t slowest_good = 0;                       ///< ns from wanting something to having it
  std::uint64_t most_live = 0, most_left = 0;          ///< live bytes added while they were there, and after it
  void add(const Tally& other);
};

/// Threading: thread-bound.
/// Ownership: world and tally outlive it.
/// Errors: failure() has the first; after it nothing is checked any more.
class Oracle {
 public:
  Oracle(World& world, const Nature& nature, Tally& tally);

  /// A process began: its books start at zero.
  void new_process();
  /// A set left capture. `held_up`: something kept frames or the rig waiting, so it may be old.
  void on_set(const firmware::FrameSet& set, bool held_up);
  /// The rig has had its turn; `captured` is when capture did, if it did.
  void after_event(firmware::Rig& rig, std::optional<Instant> captured);
  /// A raymap reached a host.
  void on_raymap(const wire::RaymapHeader& header, const std::vector<std::uint8_t>& pixels,
                 const std::array<Sha256, kCalibrations>& ids);

  const std::optional<std::string>& failure() const { return failure_; }
  void fail(const std::string& what);
  std::uint64_t trace() const { return trace_; }
  void trace(std::uint64_t what) { trace_ = (trace_ ^ what) * 0x100000001B3ULL + (trace_ >> 47); }

  // For recovery. A full set has every head; a whole one also is locked, when the trigger runs.
  void begin_to_watch();
  std::optional<Instant> first_full() const { return first_full_; }
  /// Every set has been, since then.
  std::optional<Instant> full_since() const { return full_since_; }
  std::optional<Instant> first_whole() const { return first_whole_; }
  /// Every set has been, since then.
  std::optional<Instant> whole_since() const { return whole_since_; }
  std::uint64_t sets_since() const { return sets_; }
  std::uint64_t whole_sets_since() const { return whole_sets_; }
  /// Of an aligned rig: the first full set that was locked.
  std::optional<Instant> first_in_step() const { return first_in_step_; }
  bool genlock_is_off() const { return genlock_ == firmware::GenlockState::kOff; }

 private:
  struct Remembered {
    firmware::HeadMask mask = 0;
    std::optional<std::uint64_t> trigger;
    Instant mid;
    std::optional<int> made_by;  ///< which calibration, once a raymap came
    bool exposed_alike = false;  ///< the blend has nothing to undo, so a raymap's levels are the calibration's alone
  };
  bool exposed_alike(const firmware::FrameSet& set);
  Duration period() const;
  void check_members(const firmware::FrameSet& set);
  /// Of a raymap: which field it says it is of, by what the heads deliver, and when that was exposed.
  void check_field(const wire::RaymapHeader& header, Instant set_mid);
  void check_locked(const firmware::FrameSet& set);
  void check_books(firmware::Rig& rig);
  void check_genlock(firmware::Rig& rig, std::optional<Instant> captured);

  World& world_;
  const Nature& nature_;
  Tally& tally_;
  std::optional<std::string> failure_;
  std::uint64_t trace_ = 0xcbf29ce484222325ULL;

  std::vector<std::uint64_t> taken_before_;             ///< by the head's count, when this process began
  std::vector<std::uint64_t> last_serial_;              ///< of each head, in a set
  std::array<std::optional<Stamp>, kMaxHeads> stamps_;  ///< of the set at hand
  std::optional<std::uint64_t> last_set_;
  std::uint64_t not_taken_ = 0;
  std::optional<PulseId> last_trigger_;
  firmware::GenlockState genlock_ = firmware::GenlockState::kOff;
  Instant genlock_started_;
  std::map<std::uint64_t, Remembered> remembered_;
  std::optional<hal::HeadSettings> first_exposed_;  ///< of this process
  bool ever_exposed_apart_ = false;
  std::optional<Instant> first_full_, full_since_, first_whole_, whole_since_, first_in_step_;
  Instant last_set_at_;
  std::uint64_t sets_made_ = 0;
  std::uint64_t sets_ = 0, whole_sets_ = 0;
  firmware::FrameCounts counts_;  ///< of this process, so far
};

}  // namespace nodal::swarm
