// Measures whether the pictures fit the heads' lenses.
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

}  // namespace nodal::registration
