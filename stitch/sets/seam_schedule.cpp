#include "stitch/sets/seam_schedule.h"

#include <new>
#include <utility>

#include "stitch/sets/seam_views.h"

namespace nodal::sets {

PlacedSeams place_seams(const BlendPlan& in_force, const SeamPictures& views) {
  try {
    const seams::Labels before = in_force.seam_labels ? *in_force.seam_labels : seams::Labels();
    seams::Labels labels = in_force.seams->place(views, before);
    if (labels == before) return {};
    auto placed = with_seams(in_force, std::move(labels));
    if (!placed) return {nullptr, placed.error().message};
    return {std::move(*placed), ""};
  } catch (const std::bad_alloc&) {
    return {};
  }
}

bool SeamSchedule::is_late(std::uint64_t set) {
  const std::uint64_t period = seam_period(set);
  if (!placing_ || period_ == period) return false;
  return std::exchange(late_period_, period) != period;
}

void SeamSchedule::begin(std::uint64_t set) {
  period_ = seam_period(set);
  placing_ = true;
}

const PlacedSeams* SeamSchedule::due(std::uint64_t set) const {
  if (!placed_ || (period_ && *period_ == seam_period(set))) return nullptr;
  return &*placed_;
}

PlacedSeams SeamSchedule::take() {
  placing_ = false;
  return *std::exchange(placed_, std::nullopt);
}

}  // namespace nodal::sets
