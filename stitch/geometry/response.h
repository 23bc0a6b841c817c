// A head's response: encoded value from relative light, and back; both 0..1.
#pragma once

#include "protocol/calibration.h"

namespace nodal::geometry {

/// The light that gives the encoded value; both are clamped to 0..1.
double decode(const Response& response, double encoded);

/// The encoded value of `light`; the inverse of decode.
double encode(const Response& response, double light);

}  // namespace nodal::geometry
