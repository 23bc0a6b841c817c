// When placed seams are placed, and from which set on they are in force: the same on a rig and on a host.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "stitch/sets/blend_plan.h"

namespace nodal::sets {

/// Seams are placed by the first set that is blended of every kSeamPeriod numbers, and are in force from the next such
/// period on. So they do not depend on how long placing takes, as long as that is less than a period.
inline constexpr std::uint64_t kSeamPeriod = 8;
inline std::uint64_t seam_period(std::uint64_t set) { return set / kSeamPeriod; }

struct SeamPictures;

struct PlacedSeams {
  PlanPtr plan;         ///< the plan in force, with other seams; null: they stay where they are
  std::string refused;  ///< why tables with other seams were not proven, so that the old ones stay; empty: they were
};
/// Places the seams for the set whose views are given; the plan has SeamViews. They stay, too, where there is no memory
/// for other ones.
PlacedSeams place_seams(const BlendPlan& in_force, const SeamPictures& views);

/// Which sets place seams, and from which set on placed or recorded seams are in force. Whoever blends asks it before
/// each set, places what it wants, or has it placed, and puts in force what is due.
///
/// Threading: thread-bound.
/// Ownership: holds placed seams until they are due.
/// Errors: none.
class SeamSchedule {
 public:
  /// A calibration with its own seams came into force. Seams that are being placed are for the one before, and
  /// outdated.
  void restart() { period_.reset(); }
  /// Whether the heads' views are to be made in this set, because no seams were placed in its period yet.
  bool wants(std::uint64_t set) const { return !placing_ && period_ != seam_period(set); }
  /// Whether the set would want them, but the seams before are still being placed. True for one set of a period.
  bool is_late(std::uint64_t set);

  /// The set's views are made; its seams are placed next.
  void begin(std::uint64_t set);
  /// They are placed.
  void placed(PlacedSeams seams) { placed_ = std::move(seams); }
  /// The placed seams that are due in this set: the next period has begun, or they are outdated. Null: none.
  const PlacedSeams* due(std::uint64_t set) const;
  bool outdated() const { return placing_ && !period_; }
  /// Those that are due. Others can be placed from now on.
  PlacedSeams take();

  /// For recorded seams: whether those from set `from` on (empty: the calibration's own) are not in force yet. They are
  /// afterwards.
  bool follow(std::optional<std::uint64_t> from) { return std::exchange(recorded_, from) != from; }

 private:
  bool placing_ = false;                      ///< seams are being placed, or wait to be taken
  std::optional<std::uint64_t> period_;       ///< period of the newest begin(); empty: none with this calibration
  std::optional<std::uint64_t> late_period_;  ///< the last one that is_late() was true for
  std::optional<PlacedSeams> placed_;
  std::optional<std::uint64_t> recorded_;  ///< first set of the seams in force
};

}  // namespace nodal::sets
