// Finds up: from vertical edges and the horizon, otherwise from the heads' orientations, otherwise from the light.
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

/// `pictures`: one per head, reduced by the same whole number along both sides. `held`: by head, the direction in the
/// picture, x right and y down, that is up for people who look at it; empty: (0, -1). The light of the scene comes
/// mostly from above, so vertical edges and the horizon are searched near its direction, or near the axis of a ring of
/// heads. Edges that are not seen all around are often chance; then the ring's axis decides, or else how the pictures
/// are held, all or more than half of them. The same is done if the edges say that the pictures lie on their side, as
/// lines on a floor or on walls do, unless the edges are beyond doubt.
Upright find_upright(const std::vector<geometry::Head>& heads, const std::vector<Picture>& pictures,
                     const std::vector<Eigen::Vector2d>& held = {});

/// The rotation R_new_rig that turns `up` upwards and the first head's axis to yaw 0. If that axis is vertical, the rig
/// is turned as little as possible.
Eigen::Matrix3d upright_rotation(const Eigen::Vector3d& up, const Eigen::Vector3d& forward);

}  // namespace nodal::autocalibration
