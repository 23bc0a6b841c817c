#include "stitch/registration/gauge.h"

#include <algorithm>

#include "stitch/geometry/rotation.h"

namespace nodal::registration {

void hold_mean(const std::vector<HeadState>& start, const std::vector<bool>& placed, std::vector<HeadState>& heads) {
  const auto count = static_cast<double>(std::ranges::count(placed, true));
  // The mean of turns is no linear thing; Newton's steps to where it is zero gain digits by the pair.
  for (int round = 0; round < 8 && count > 0; ++round) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (!placed[h]) continue;
      // In the rig's frame: start = found * turn.
      const Eigen::AngleAxisd turn((heads[h].q_head_rig.conjugate() * start[h].q_head_rig).normalized());
      mean += turn.angle() * turn.axis() / count;
    }
    const Eigen::Quaterniond back(geometry::rotation_about(mean));
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (placed[h]) heads[h].q_head_rig = (heads[h].q_head_rig * back).normalized();
    }
    if (mean.norm() < 1e-14) return;
  }
}

Eigen::MatrixXd mean_taken_out(const std::vector<HeadState>& heads, const std::vector<bool>& placed,
                               const Parameters& parameters) {
  const Eigen::Index rows = parameters.basis().rows();
  Eigen::MatrixXd all = Eigen::MatrixXd::Identity(rows, rows);
  const auto count = static_cast<double>(std::ranges::count(placed, true));
  const auto row_of = [&](std::size_t h) {
    return static_cast<Eigen::Index>(h) * parameters.stride() + parameters.slots()[h].rotation;
  };
  for (std::size_t a = 0; a < heads.size(); ++a) {
    if (!placed[a] || parameters.slots()[a].rotation < 0) continue;
    const Eigen::Matrix3d R_a = heads[a].q_head_rig.toRotationMatrix();
    for (std::size_t b = 0; b < heads.size(); ++b) {
      if (!placed[b] || parameters.slots()[b].rotation < 0) continue;
      const Eigen::Matrix3d R_b = heads[b].q_head_rig.toRotationMatrix();
      all.block<3, 3>(row_of(a), row_of(b)) -= R_a * R_b.transpose() / count;
    }
  }
  return all;
}

}  // namespace nodal::registration
