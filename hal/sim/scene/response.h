// The curve between light and the numbers a head sends, both ways, as the calibration states it.
#pragma once

#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// Encoded value 0..1 of relative light; light below 0 and above 1 is clipped.
double encode(const Response& response, double light);
/// Relative light of an encoded value 0..1.
double decode(const Response& response, double encoded);

}  // namespace nodal::hal::sim
