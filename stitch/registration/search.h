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

/// A rotation, besides the one that a head has, with which it agrees with its neighbours.
struct Rival {
  std::size_t head = 0;
  Eigen::Quaterniond q_head_rig = Eigen::Quaterniond::Identity();
  double turned = 0;   ///< from the rotation that it has, rad
  double support = 0;  ///< significance of the agreement, relative to that of the rotation that it has
};

/// Rivals of the rotations of used heads that overlap with one or two others, found as search_rotations() finds heads:
/// the best first. Where nothing repeats, their support is below a third; one tile or window off it may be almost 1.
///
/// Errors: those of the lenses.
Result<std::vector<Rival>> rival_rotations(const std::vector<HeadPyramid>& pyramids,
                                           const std::vector<HeadState>& heads, const std::vector<bool>& used,
                                           const parallel::Workers& workers);

}  // namespace nodal::registration
