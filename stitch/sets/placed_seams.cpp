#include "stitch/sets/placed_seams.h"

#include <new>
#include <utility>

#include "stitch/sets/seam_views.h"

namespace nodal::sets {

PlacedSeams place_seams(const InstalledCalibration& in_force) {
  try {
    const seams::Labels before = in_force.seam_labels ? *in_force.seam_labels : seams::Labels();
    seams::Labels labels = in_force.seams->place(*in_force.seam_pictures, before);
    if (labels == before) return {};
    auto placed = with_seams(in_force, std::move(labels));
    if (!placed) return {nullptr, placed.error().message};
    return {std::move(*placed), ""};
  } catch (const std::bad_alloc&) {
    return {};
  }
}

}  // namespace nodal::sets
