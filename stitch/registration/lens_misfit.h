// Measures whether the pictures fit the heads' lenses, and whether near things cause what remains.
#pragma once

#include "protocol/base/result.h"
#include "stitch/registration/objective.h"
#include "stitch/registration/parameters.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// The share of the objective that one more step would remove if focal lengths or whole lenses were estimated, too.
/// Close to 0 if the lenses are right, independent of noise.
/// Errors: those of Objective::evaluate().
Result<double> promised_by(Objective& objective, const std::vector<HeadState>& heads, Sought sought, const Held& held,
                           Free free);

/// What an estimated distance would change.
struct Parallax {
  double share = 0;     ///< of the objective that one more step would remove
  double nearness = 0;  ///< 1 / distance after that step, 1/m
};
/// 0 if no head has a position. Errors: those of Objective::evaluate().
Result<Parallax> parallax_in(Objective& objective, const std::vector<HeadState>& heads, Sought sought,
                             const Held& held);

}  // namespace nodal::registration
