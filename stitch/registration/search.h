// Finds heads that are too far from the prior for a descent: tries rotations, pair by pair.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/level.h"

namespace nodal::registration {

/// The largest rotation of two heads against each other, relative to the prior, that is searched, degrees.
inline constexpr double kSearchedDeg = 32;

/// Correlates the detail of every two heads that may overlap, for all turns up to kSearchedDeg, on coarse pictures, and
/// combines the best turns of the pairs. Accurate to about a degree; a descent from coarse levels follows. Heads whose
/// `used` is false keep their rotation, and so does the first used head.
///
/// Errors: those of the lenses.
Result<std::vector<HeadState>> search_rotations(const std::vector<HeadPyramid>& pyramids,
                                                const std::vector<HeadState>& heads, const std::vector<bool>& used,
                                                const parallel::Workers& workers);

}  // namespace nodal::registration
