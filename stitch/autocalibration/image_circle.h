// The image circle of a fisheye, in one picture of an ordinary scene.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/autocalibration/picture.h"

namespace nodal::autocalibration {

/// The circle outside of which the picture is dark, if there is one; it may extend beyond the picture. Its edge may be
/// blurred, and things in the scene may be dark up to it: a third of the visible edge is enough. The radius is that of
/// the inner side of the blurred edge.
std::optional<Region::Circle> find_image_circle(const Picture& picture);

}  // namespace nodal::autocalibration
