// Placed seams on a rig: when they are placed, come into force and are recorded.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "firmware/frame/snapshot.h"
#include "firmware/picture/seam_log.h"
#include "firmware/picture/seam_stage.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/sets/seam_schedule.h"
#include "stitch/sets/set_blend.h"

namespace nodal::firmware {

/// Follows sets::SeamSchedule: has the seam stage place seams, puts its answers in force between two sets, and logs the
/// changes for takes. With a calibration whose seams are fixed it does nothing.
///
/// Threading: the rings' other ends are the seam stage's and the takes', one thread each; refused() is for control;
///   counts() may be read by any. The other calls are for the thread that coordinates the blend.
/// Errors: none.
class MovingSeams {
 public:
  /// The seam stage's work, and what it made of it. One request is under way at most.
  SpscRing<SeamRequest>& requests() { return requests_; }
  SpscRing<SeamAnswer>& answers() { return answers_; }
  /// Which seams sets are blended with, for takes.
  SeamLog& log() { return log_; }
  const SeamLog& log() const { return log_; }
  /// The reason of the newest refusal.
  Snapshot<std::string>& refused() { return refused_; }

  struct Counts {
    std::atomic<std::uint64_t> moved{0};    ///< tables with other seams put in force
    std::atomic<std::uint64_t> late{0};     ///< periods without placing: the one before was not done
    std::atomic<std::uint64_t> refused{0};  ///< tables with other seams that were not proven
  };
  const Counts& counts() const { return counts_; }

  /// A calibration came into force; seams that are being placed are for the one before.
  void restart() { schedule_.restart(); }
  /// For every set before it is blended or skipped: puts placed seams in force if they are due. `first`: the first set
  /// with a calibration. Plans that are not used any more go to `replaced`.
  void begin(std::uint64_t set, bool first, sets::SetBlend& blend, SpscRing<sets::BlendSetup>& replaced);
  /// Whether the heads' views are to be made in this set, which is blended.
  bool wants_views(std::uint64_t set, const sets::BlendPlan& plan);
  /// Has seams placed by the views of the set, if it has any.
  void place(std::uint64_t set, const sets::SetBlend& blend);

 private:
  void move(std::uint64_t set, sets::SetBlend& blend, SpscRing<sets::BlendSetup>& replaced);
  void note(std::uint64_t set, const sets::BlendPlan& plan);

  SpscRing<SeamRequest> requests_{1};
  SpscRing<SeamAnswer> answers_{1};
  SeamLog log_;
  std::optional<SeamChange> change_;  ///< waits for room in the log
  sets::SeamSchedule schedule_;
  Snapshot<std::string> refused_;
  Counts counts_;
};

}  // namespace nodal::firmware
