#include "stitch/geometry/turned_rig.h"

#include "stitch/geometry/rotation.h"

namespace nodal::geometry {

Calibration turned_rig(Calibration rig, const Eigen::Matrix3d& R_new_rig) {
  for (HeadCalibration& head : rig.heads) {
    head.R_head_rig = rows_of(matrix_of(head.R_head_rig) * R_new_rig.transpose());
    const Eigen::Vector3d position = R_new_rig * Eigen::Vector3d(head.position[0], head.position[1], head.position[2]);
    head.position = {position.x(), position.y(), position.z()};
  }
  return rig;
}

}  // namespace nodal::geometry
