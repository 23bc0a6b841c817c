// The image circle of a fisheye, in one picture of an ordinary scene.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/autocalibration/picture.h"

namespace nodal::autocalibration {

/// The circle outside of which the picture is dark, if there is one; it may extend beyond the picture. Its edge may be
/// blurred and partly hidden by dark things in the scene: a third of it must be visible. The radius is that of the
/// inner side of the blurred edge.
std::optional<Region::Circle> find_image_circle(const Picture& picture);

}  // namespace nodal::autocalibration
