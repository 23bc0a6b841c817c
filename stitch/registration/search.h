// Searches heads that are too far from the prior for a descent: tries rotations, pair by pair.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/level.h"

namespace nodal::registration {

/// How far two heads may be turned against each other beyond what the prior says, degrees.
inline constexpr double kSearchedDeg = 32;

/// Correlates the detail of every two heads that may overlap under all turns up to kSearchedDeg, on coarse pictures, and
/// puts the heads where most of it agrees. Good to about a degree; a descent from coarse levels follows. Heads whose
/// `used` is false stay; the first used one does too.
///
/// Errors: those of the lenses.
Result<std::vector<HeadState>> search_rotations(const std::vector<HeadPyramid>& pyramids,
                                                const std::vector<HeadState>& heads, const std::vector<bool>& used,
                                                const Workers& workers);

}  // namespace nodal::registration
