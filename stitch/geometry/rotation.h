// The only conversion between users' angles and rotations: yaw to the right, pitch up, roll clockwise, degrees.
#pragma once

#include <Eigen/Core>
#include <array>

#include "protocol/base/result.h"

namespace nodal::geometry {

/// A head's orientation in the rig in users' angles: first turned right by yaw, then tilted up by pitch, then
/// rolled clockwise (as seen from behind the head) by roll. Degrees.
struct YawPitchRoll {
  double yaw = 0;
  double pitch = 0;
  double roll = 0;
};

/// R_head_rig of a head with this orientation: the transpose of Ry(yaw) Rx(pitch) Rz(roll).
Eigen::Matrix3d to_R_head_rig(const YawPitchRoll& degrees);

/// The inverse: yaw and roll in -180..180, pitch in -90..90. At pitch 90 or -90 roll is 0 and yaw holds all rotation.
YawPitchRoll to_yaw_pitch_roll(const Eigen::Matrix3d& R_head_rig);

/// The rotation nearest to a matrix that is a rotation up to rounding (at most `tolerance` per element of R Rᵀ - 1).
/// Errors: kNotARotation, with a message that says whether it is a reflection or not orthonormal at all.
Result<Eigen::Matrix3d> nearest_rotation(const Eigen::Matrix3d& R, double tolerance = 1e-6);

/// The rotation by |w| radians about w, right-handed; the identity for w = 0. For registration's small steps.
Eigen::Matrix3d rotation_about(const Eigen::Vector3d& w);

/// The matrix with these elements, row-major as in the calibration document.
Eigen::Matrix3d matrix_of(const std::array<double, 9>& rows);
std::array<double, 9> rows_of(const Eigen::Matrix3d& R);

}  // namespace nodal::geometry
