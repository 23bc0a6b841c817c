// Which way is up: from the light, from vertical edges and from the horizon.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/autocalibration/picture.h"
#include "stitch/geometry/head.h"

namespace nodal::autocalibration {

struct Upright {
  Eigen::Vector3d up{0, -1, 0};  ///< in the rig's frame, length 1
  /// Edges all around agree on it. Otherwise it is where the light comes from, or a pattern such as lines on the ground may
  /// have led astray.
  bool sure = false;
};

/// `pictures`: one a head, of the size of the head's picture divided by the same whole number for both sides.
/// The light of the scene comes mostly from above; near that direction, or near the axis that all heads of a ring have in
/// common, the direction is chosen which most vertical edges and the horizon agree on.
Upright find_upright(const std::vector<geometry::Head>& heads, const std::vector<Picture>& pictures);

/// The rotation R_new_rig that turns `up` upwards and the first head's axis to yaw 0. If that axis is vertical, the rig is
/// turned as little as possible.
Eigen::Matrix3d upright_rotation(const Eigen::Vector3d& up, const Eigen::Vector3d& forward);

}  // namespace nodal::autocalibration
