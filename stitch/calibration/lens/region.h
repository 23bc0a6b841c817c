// The used region of a head's pictures: decentred sensors and fisheyes leave black borders (§4.3).
#pragma once

#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/lens/grey_image.h"

namespace nodal::calibration {

/// How much smaller than its edge the circle of a region is, px: the edge is blurred.
inline constexpr double kEdgeBlur = 1;

/// The region that is not black in all of the pictures (of one size): the picture without black bands, or a circle when
/// what is bright is one, with a radius kEdgeBlur less than its edge's. A picture that is dark here or there is no border:
/// only what stays black everywhere is.
Region find_region(const std::vector<const GreyImage*>& pictures);

}  // namespace nodal::calibration
