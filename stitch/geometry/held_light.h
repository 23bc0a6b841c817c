// Gains and fall-offs of a fit, moved to what a calibration may have.
#pragma once

#include "protocol/calibration.h"

namespace nodal::geometry {

/// Clamps the head's gains, and takes a smaller share of its fall-off, so that check_head() accepts them: a fit at its
/// bounds is then still a result. Whether anything was moved. A head that is refused for something else is left as it
/// is.
bool hold_light(HeadCalibration& head);

}  // namespace nodal::geometry
