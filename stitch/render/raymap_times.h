// When the raymaps of a take were exposed.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/evidence.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::render {

struct RaymapTimes {
  std::vector<Instant> at;  ///< middle of each raymap's exposure, in the order of TakeRender
  FrameRate sets;           ///< rate of sets when the take began
};

/// Reads the evidence of a take, without pictures. `raymaps_a_set`: 2 if each field has a raymap.
/// Errors: those of TakeFolder; kNotFound if the take has no sets.
Result<RaymapTimes> raymap_times(const media::TakeFolder& folder, int raymaps_a_set);

/// How much later than the first the second field of a frame in this segment was exposed. `sets`: the take's rate.
Duration second_field(const take::wire::Begin& begin, FrameRate sets);

}  // namespace nodal::render
