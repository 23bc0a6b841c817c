// The curve between light and a head's values, in both directions, as defined by the calibration.
#pragma once

#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// The encoded value 0..1 of relative light; light below 0 and above 1 is clipped.
double encode(const Response& response, double light);
/// The relative light of an encoded value 0..1.
double decode(const Response& response, double encoded);

}  // namespace nodal::hal::sim
