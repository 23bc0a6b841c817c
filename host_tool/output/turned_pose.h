// What Photo Sphere metadata say of a sphere that was turned.
#pragma once

#include "stitch/geometry/rotation.h"
#include "stitch/media/gpano.h"

namespace nodal::host {

/// Turns the pose, as far as it is stated. The first view is stated relative to north, and stays; without a heading it
/// is relative to the picture, and turns with it.
void turn_pose(media::XmpProperties& properties, const Eigen::Matrix3d& R_new_old);

}  // namespace nodal::host
