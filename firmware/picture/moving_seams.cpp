#include "firmware/picture/moving_seams.h"

#include <utility>

#include "protocol/base/result.h"

namespace nodal::firmware {

void MovingSeams::begin(std::uint64_t set, bool first, sets::SetBlend& blend, SpscRing<sets::BlendSetup>& replaced) {
  if (first) note(set, *blend.plan());
  move(set, blend, replaced);
  if (change_ && log_.changes().push(std::move(*change_))) change_.reset();
  log_.begin(set);
}

/// Puts the placed seams in force if they are due. Outdated ones are given back.
void MovingSeams::move(std::uint64_t set, sets::SetBlend& blend, SpscRing<sets::BlendSetup>& replaced) {
  if (auto placed = answers_.pop()) schedule_.placed(std::move(*placed));
  const sets::PlacedSeams* due = schedule_.due(set);
  if (!due || (due->plan && replaced.full())) return;
  const bool outdated = schedule_.outdated();
  if (!outdated && (log_.changes().full() || change_)) return;
  sets::PlacedSeams placed = schedule_.take();
  if (placed.plan && outdated) {
    replaced.push({std::move(placed.plan), nullptr});
  } else if (placed.plan) {
    replaced.push({blend.move_seams(std::move(placed.plan)), nullptr});
    counts_.moved.fetch_add(1, std::memory_order_relaxed);
    note(set, *blend.plan());
  } else if (!placed.refused.empty()) {
    refused_.publish(placed.refused);
    counts_.refused.fetch_add(1, std::memory_order_release);  // after the reason, for its reader
  }
}

/// The seams in force from this set on. While the ring is full, no seams are placed, so a change that waits for room is
/// that of a new calibration to its own seams; further calibrations have their own seams, too, and need no further
/// record.
void MovingSeams::note(std::uint64_t set, const sets::BlendPlan& plan) {
  if (log_.is_open() && plan.seams && !change_) change_ = SeamChange{set, plan.seam_labels};
}

bool MovingSeams::wants_views(std::uint64_t set, const sets::BlendPlan& plan) {
  if (!plan.seams) return false;
  if (schedule_.is_late(set)) counts_.late.fetch_add(1, std::memory_order_relaxed);
  return schedule_.wants(set);
}

void MovingSeams::place(std::uint64_t set, const sets::SetBlend& blend) {
  auto views = blend.views();
  if (!views) return;
  schedule_.begin(set);
  const bool pushed = requests_.push({blend.plan(), std::move(views)});
  NODAL_ASSERT(pushed);
}

}  // namespace nodal::firmware
