// Converts lenses to another model, so that pictures can show which model fits better.
#pragma once

#include <optional>

#include "protocol/calibration.h"

namespace nodal::autocalibration {

/// The rig with its Kannala-Brandt lenses as Tsai's (§4.3), whose two coefficients fit lenses that are nearly
/// rectilinear more closely. Nothing if a lens is of another model, sees too far from its axis, or differs by more than
/// 1 %.
std::optional<Calibration> with_tsai_lenses(const Calibration& rig);

}  // namespace nodal::autocalibration
