// Whether the pictures fit the heads' lenses.
#pragma once

#include "protocol/base/result.h"
#include "stitch/registration/objective.h"
#include "stitch/registration/parameters.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// The share of the objective that one more step would take away, were focals or whole lenses free, too. Near nothing
/// when the lenses that are held are right, whatever the noise.
/// Errors: those of evaluating.
Result<double> promised_by(Objective& objective, const std::vector<HeadState>& heads, Sought sought, const Held& held,
                           Free free);

}  // namespace nodal::registration
