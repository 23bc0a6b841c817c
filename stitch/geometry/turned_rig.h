// A rig in another frame.
#pragma once

#include <Eigen/Core>

#include "protocol/calibration.h"

namespace nodal::geometry {

/// The same rig with its frame turned by `R_new_rig`: rotations and positions of all heads follow.
Calibration turned_rig(Calibration rig, const Eigen::Matrix3d& R_new_rig);

}  // namespace nodal::geometry
