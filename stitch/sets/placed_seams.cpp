#include "stitch/sets/placed_seams.h"

#include <new>
#include <utility>

#include "stitch/sets/seam_views.h"

namespace nodal::sets {

InstalledPtr place_seams(const InstalledCalibration& in_force) {
  try {
    const seams::Labels labels = in_force.seams->place(*in_force.seam_pictures, in_force.seam_labels);
    if (labels == in_force.seam_labels) return nullptr;
    auto placed = with_seams(in_force, labels);
    NODAL_ASSERT(placed);  // the same patches as in a table that was proven, and weights that sum to one
    return std::move(*placed);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

}  // namespace nodal::sets
