// Which way is up: from vertical edges and the horizon, or else from how the heads stand and are held, or from the
// light.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/autocalibration/picture.h"
#include "stitch/autocalibration/stance.h"
#include "stitch/geometry/head.h"

namespace nodal::autocalibration {

struct Upright {
  Eigen::Vector3d up{0, -1, 0};  ///< unit vector in the rig's frame
  UpBasis basis = UpBasis::kLight;
};

/// `pictures`: one a head, of the size of the head's picture divided by the same whole number for both sides. `held`:
/// by head, the direction in the picture, x right and y down, that is up for people who look at it; empty: its rows go
/// down. The light of the scene comes mostly from above; near that direction, or near the axis that all heads of a ring
/// have in common, vertical edges and the horizon are looked for. If they are not seen all around, they are often
/// chance; then the axis of the ring decides, or else how the pictures are held. So it does where edges say that the
/// pictures lie on their side, as the lines on a floor and on walls do, unless the edges are beyond doubt.
Upright find_upright(const std::vector<geometry::Head>& heads, const std::vector<Picture>& pictures,
                     const std::vector<Eigen::Vector2d>& held = {});

/// The rotation R_new_rig that turns `up` upwards and the first head's axis to yaw 0. If that axis is vertical, the rig
/// is turned as little as possible.
Eigen::Matrix3d upright_rotation(const Eigen::Vector3d& up, const Eigen::Vector3d& forward);

}  // namespace nodal::autocalibration
