#include <algorithm>
#include <cmath>

#include "host_tool/look/workbench.h"
#include "protocol/base/try.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/turned_rig.h"
#include "stitch/view/tangent.h"

namespace nodal::host::look {
namespace {

constexpr double kMinSine = 0.03;  // sine of the angle between directions that determine a plane: 1.7 degrees

/// The axes of graphics and of rays differ by half a turn about x.
Eigen::Vector3d in_rig(const Eigen::Vector3d& graphics) { return {graphics.x(), -graphics.y(), -graphics.z()}; }

/// The normal of the plane through the centre that the directions are nearest to; 0 if they are too close together.
Eigen::Vector3d normal_of(const std::vector<Eigen::Vector3d>& directions) {
  Eigen::Vector3d sum(0, 0, 0);
  double largest = 0;
  for (std::size_t a = 0; a < directions.size(); ++a) {
    for (std::size_t b = a + 1; b < directions.size(); ++b) {
      const Eigen::Vector3d cross = in_rig(directions[a]).normalized().cross(in_rig(directions[b]).normalized());
      largest = std::max(largest, cross.norm());
      sum += sum.dot(cross) < 0 ? Eigen::Vector3d(-cross) : cross;
    }
  }
  return largest < kMinSine || sum.norm() < kMinSine ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d(sum.normalized());
}

/// The rig turned by the smallest rotation that brings a direction up.
Calibration with_up(const Calibration& calibration, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d up(0, -1, 0);
  const Eigen::Vector3d axis = direction.cross(up);
  const double angle = std::atan2(axis.norm(), direction.dot(up));
  if (axis.norm() < 1e-12) return calibration;
  return geometry::turned_rig(calibration, geometry::rotation_about(axis.normalized() * angle));
}

}  // namespace

Calibration turned_by_hand(Calibration calibration, const std::vector<std::size_t>& heads,
                           const Eigen::Vector3d& about) {
  const Eigen::Matrix3d R = geometry::rotation_about(in_rig(about));
  for (const std::size_t k : heads) {
    HeadCalibration& head = calibration.heads[k];
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * R.transpose());
  }
  return calibration;
}

Result<Calibration> levelled(const Calibration& calibration, const std::vector<Eigen::Vector3d>& horizon) {
  const Eigen::Vector3d normal = normal_of(horizon);
  if (normal.isZero(0))
    return fail(Errc::kBadValue, "the points of the horizon are too close together; click farther apart");
  return with_up(calibration, normal.y() > 0 ? Eigen::Vector3d(-normal) : normal);
}

Result<Calibration> upright(const Calibration& calibration, const std::vector<Eigen::Vector3d>& vertical) {
  const Eigen::Vector3d normal = normal_of(vertical);
  const Eigen::Vector3d up(0, -1, 0);
  const Eigen::Vector3d within = up - up.dot(normal) * normal;
  if (normal.isZero(0) || within.norm() < kMinSine) {
    return fail(Errc::kBadValue,
                "the points do not say what is vertical; click points one above the other, farther apart");
  }
  return with_up(calibration, within.normalized());
}

}  // namespace nodal::host::look
