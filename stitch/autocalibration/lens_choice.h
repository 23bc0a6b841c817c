// Which family the shared lens belongs to, and at which radii the matches determine it.
#pragma once

#include <vector>

#include "stitch/autocalibration/bundle.h"
#include "stitch/autocalibration/lens_family.h"
#include "stitch/parallel/workers.h"

namespace nodal::autocalibration {

struct LensChoice {
  BundleFit fit;
  BundleRules rules;  ///< the rules by which the fit was made
  LensEvidence evidence;
};

/// Adjusts `start` with a lens near each family that reaches as far, and takes the one that fits best, or the commonest
/// family if matches do not distinguish them. Where there are no matches, the lens is then that of the family.
LensChoice choose_lens(const BundleState& start, const std::vector<UnitMatch>& matches, const BundleRules& rules,
                       const parallel::Workers& workers);

/// Adjusts again with small differences between the heads' lenses. The result is used only if it agrees better with
/// points that the fit has not used: first one half of the points is kept back, then the other half.
BundleFit with_own_lenses(const BundleFit& fit, const std::vector<UnitMatch>& matches, const BundleRules& rules,
                          const parallel::Workers& workers);

}  // namespace nodal::autocalibration
