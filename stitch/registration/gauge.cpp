#include "stitch/registration/gauge.h"

#include <algorithm>
#include <cmath>

#include "stitch/geometry/rotation.h"

namespace nodal::registration {

namespace {

Eigen::Vector3d mean_of(const std::vector<Eigen::Vector3d>& turns) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& turn : turns) sum += turn;
  return sum / static_cast<double>(turns.size());
}

// Weiszfeld's iteration: a mean with weights 1 / distance. Distances below `same` count as `same`, which keeps the
// weights finite.
Eigen::Vector3d geometric_median_of(const std::vector<Eigen::Vector3d>& turns) {
  constexpr double kSame = 1e-6;
  Eigen::Vector3d median = mean_of(turns);
  for (int round = 0; round < 200; ++round) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const Eigen::Vector3d& turn : turns) {
      const double weight = 1 / std::hypot((turn - median).norm(), kSame);
      sum += weight * turn;
      weights += weight;
    }
    const Eigen::Vector3d next = sum / weights;
    const double step = (next - median).norm();
    median = next;
    if (step < 1e-12) break;
  }
  return median;
}

Eigen::Vector3d middle_of(Gauge gauge, const std::vector<Eigen::Vector3d>& turns) {
  switch (gauge) {
    case Gauge::kFirstHead: return turns.front();
    case Gauge::kMean: return mean_of(turns);
    case Gauge::kMedian: return geometric_median_of(turns);
  }
  return Eigen::Vector3d::Zero();
}

}  // namespace

void hold_together(Gauge gauge, const std::vector<HeadState>& start, const std::vector<bool>& placed,
                   std::vector<HeadState>& heads) {
  // The mean of rotations is not linear; Newton's method finds where it is zero and converges quadratically.
  for (int round = 0; round < 8; ++round) {
    std::vector<Eigen::Vector3d> turns;
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (!placed[h]) continue;
      // In the rig's frame: start = found * turn.
      const Eigen::AngleAxisd turn((heads[h].q_head_rig.conjugate() * start[h].q_head_rig).normalized());
      turns.push_back(turn.angle() * turn.axis());
    }
    if (turns.empty()) return;
    const Eigen::Vector3d middle = middle_of(gauge, turns);
    if (middle.isZero(0)) return;
    const Eigen::Quaterniond back(geometry::rotation_about(middle));
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (placed[h]) heads[h].q_head_rig = (heads[h].q_head_rig * back).normalized();
    }
    if (middle.norm() < 1e-14) return;
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
