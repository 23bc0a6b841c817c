// The used region of a head's pictures: decentred sensors and fisheyes leave black borders (§4.3).
#pragma once

#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/lens/grey_image.h"

namespace nodal::calibration {

/// The radius of a region's circle is this much smaller than its edge's, px, because the edge is blurred.
inline constexpr double kEdgeBlur = 1;

/// The region that is not black in all of the pictures (of one size): the picture without black bands, or a circle if
/// the bright part is one, with a radius kEdgeBlur smaller than its edge's. Only pixels that are black in every picture
/// count as border.
Region find_region(const std::vector<const GreyImage*>& pictures);

}  // namespace nodal::calibration
