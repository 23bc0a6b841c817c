#include "stitch/geometry/rotation.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {}  // namespace

Eigen::Matrix3d to_R_head_rig(const YawPitchRoll& degrees) {
  // Positive rotations about y (down) turn right, about x (right) tilt up, about z (forward) roll clockwise.
  const Eigen::Matrix3d R_rig_head = (Eigen::AngleAxisd(degrees.yaw * kRadiansPerDegree, Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(degrees.pitch * kRadiansPerDegree, Eigen::Vector3d::UnitX()) *
                                      Eigen::AngleAxisd(degrees.roll * kRadiansPerDegree, Eigen::Vector3d::UnitZ()))
                                         .toRotationMatrix();
  return R_rig_head.transpose();
}

YawPitchRoll to_yaw_pitch_roll(const Eigen::Matrix3d& R_head_rig) {
  const Eigen::Matrix3d R = R_head_rig.transpose();
  // R = Ry Rx Rz: third column (sin y cos p, -sin p, cos y cos p), second row (cos p sin r, cos p cos r, -sin p).
  const double level = std::hypot(R(0, 2), R(2, 2));
  const double pitch = std::atan2(-R(1, 2), level);
  if (level < 1e-9) return {std::atan2(-R(2, 0), R(0, 0)) / kRadiansPerDegree, pitch / kRadiansPerDegree, 0};
  return {std::atan2(R(0, 2), R(2, 2)) / kRadiansPerDegree, pitch / kRadiansPerDegree,
          std::atan2(R(1, 0), R(1, 1)) / kRadiansPerDegree};
}

Result<Eigen::Matrix3d> nearest_rotation(const Eigen::Matrix3d& R, double tolerance) {
  if (!R.allFinite()) return fail(Errc::kNotARotation, "the matrix has elements that are not finite");
  const double off = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > tolerance) {
    return fail(Errc::kNotARotation,
                fmt::format("the matrix is not orthonormal: R times its transpose is off the identity by {:f}", off));
  }
  if (R.determinant() < 0) {
    return fail(Errc::kNotARotation,
                "the matrix is a reflection (its determinant is -1): one axis points the wrong way");
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose());
}

Eigen::Matrix3d rotation_about(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Eigen::Matrix3d matrix_of(const std::array<double, 9>& rows) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
}

std::array<double, 9> rows_of(const Eigen::Matrix3d& R) {
  std::array<double, 9> rows;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data()) = R;
  return rows;
}

}  // namespace nodal::geometry
