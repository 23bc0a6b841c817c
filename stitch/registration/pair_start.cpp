#include "stitch/registration/pair_start.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "protocol/base/angles.h"

namespace nodal::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Two points closer to each other do not determine the rotation about them.
constexpr double kMinBase = 2 * kRadiansPerDegree;
constexpr std::size_t kMaxTried = 1500;
constexpr int kMaxAttempts = 4;

struct Joint {
  Matrix3d R_b_a = Matrix3d::Identity();
  int agreeing = 0;
  double trust = 0;
};

double between(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

// An orthonormal frame from two directions: the middle, and across it.
Matrix3d frame_of(const Vector3d& p, const Vector3d& q) {
  Matrix3d frame;
  frame.col(0) = (p + q).normalized();
  frame.col(1) = p.cross(q).normalized();
  frame.col(2) = frame.col(0).cross(frame.col(1));
  return frame;
}

// The least-squares rotation from the rays of a to those of b (Kabsch's algorithm).
Matrix3d best_rotation(const std::vector<RayPair>& pairs, const Matrix3d& near, double tolerance) {
  Matrix3d sum = Matrix3d::Zero();
  for (const RayPair& pair : pairs) {
    if (between(near * pair.ray_a, pair.ray_b) < tolerance) sum += pair.ray_b * pair.ray_a.transpose();
  }
  const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * Vector3d(1, 1, sign < 0 ? -1 : 1).asDiagonal() * svd.matrixV().transpose();
}

/// The number of pairs that agree with a rotation; `enough` or less as soon as there cannot be more.
int agreeing(const std::vector<RayPair>& pairs, const Matrix3d& R_b_a, double tolerance, int enough) {
  const double chord = 2 * std::sin(tolerance / 2), most = chord * chord;
  auto count = static_cast<int>(pairs.size());
  for (const RayPair& pair : pairs) {
    if ((R_b_a * pair.ray_a - pair.ray_b).squaredNorm() < most) continue;
    if (--count <= enough) return count;
  }
  return count;
}

/// The combination (i, j), i < j < n, with this number: (0, 1), (0, 2) .. (0, n - 1), (1, 2) ..
std::pair<std::size_t, std::size_t> combination(std::size_t number, std::size_t n) {
  // Row i begins at i n - i (i + 1) / 2: the smaller root, and then its neighbours because of rounding.
  const double m = 2 * static_cast<double>(n) - 1;
  auto i = static_cast<std::size_t>((m - std::sqrt(std::max(0.0, m * m - 8 * static_cast<double>(number)))) / 2);
  const auto begin = [n](std::size_t row) { return row * n - row * (row + 1) / 2; };
  while (i > 0 && begin(i) > number) --i;
  while (begin(i + 1) <= number) ++i;
  return {i, i + 1 + (number - begin(i))};
}

/// Number of combinations of two pairs to try, so that with a probability of 1 - 1e-6 both pairs of one of them agree
/// with the best rotation. `share`: of all pairs, those that agree with it.
double tries_for(double share) {
  const double both = share * share;
  return both < 1 ? std::log(1e-6) / std::log1p(-both) : 1;
}

Joint joint_of(const std::vector<RayPair>& pairs, double tolerance) {
  Joint best;
  const std::size_t n = pairs.size(), all = n * (n - 1) / 2;
  // Combinations (i, j) with i < j are numbered row by row. If there are too many, a part of them is tried, the same
  // every time: steps of a golden section, which has no divisor in common with their number, visit all of them evenly.
  std::size_t step = std::max<std::size_t>(1, static_cast<std::size_t>(0.6180339887 * static_cast<double>(all)));
  while (std::gcd(step, all) > 1) ++step;
  std::size_t number = 0;
  double enough = kMaxTried;
  int useful = 0;
  const auto keep_better = [&](const Matrix3d& R) {
    const int count = agreeing(pairs, R, tolerance, best.agreeing);
    if (count <= best.agreeing) return false;
    best = {R, count, 0};
    enough = tries_for(count / static_cast<double>(n));
    return true;
  };
  for (std::size_t tried = 0; tried < std::min(all, kMaxTried) && useful < enough;
       ++tried, number = (number + step) % all) {
    const auto [i, j] = combination(number, n);
    const double apart_a = between(pairs[i].ray_a, pairs[j].ray_a), apart_b = between(pairs[i].ray_b, pairs[j].ray_b);
    if (std::min(apart_a, apart_b) <= kMinBase || std::max(apart_a, apart_b) >= std::numbers::pi - 0.1) continue;
    ++useful;
    if (std::abs(apart_a - apart_b) > 2 * tolerance) continue;
    // A rotation by two pairs has their errors; the one by all that agree with it is more accurate.
    if (!keep_better(frame_of(pairs[i].ray_b, pairs[j].ray_b) * frame_of(pairs[i].ray_a, pairs[j].ray_a).transpose()))
      continue;
    while (keep_better(best_rotation(pairs, best.R_b_a, tolerance))) {}
  }
  if (best.agreeing > 0) best.R_b_a = best_rotation(pairs, best.R_b_a, tolerance);
  return best;
}

/// The connections between heads.
struct Joints {
  std::map<std::pair<std::size_t, std::size_t>, Joint> by_heads;
  std::vector<int> of_head;  ///< pairs that agree, of each head's connections
  int agreeing = 0;
};

Joints find_joints(std::size_t heads_of_rig, const std::vector<RayPair>& pairs, const PairRules& rules) {
  std::map<std::pair<std::size_t, std::size_t>, std::vector<RayPair>> by_heads;
  for (const RayPair& pair : pairs) by_heads[{pair.a, pair.b}].push_back(pair);
  Joints joints{{}, std::vector<int>(heads_of_rig), 0};
  for (auto& [heads, theirs] : by_heads) {
    const double share = rules.least_share * static_cast<double>(theirs.size());
    for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
      Joint joint = joint_of(theirs, rules.tolerance);
      if (joint.agreeing < rules.least || joint.agreeing < share) break;
      joint.trust = rules.trust ? rules.trust(heads.first, heads.second, joint.R_b_a) : joint.agreeing;
      if (joint.trust <= 0) {
        std::erase_if(theirs, [&](const RayPair& pair) {
          return between(joint.R_b_a * pair.ray_a, pair.ray_b) < rules.tolerance;
        });
        continue;
      }
      joints.by_heads[heads] = joint;
      joints.agreeing += joint.agreeing;
      joints.of_head[heads.first] += joint.agreeing;
      joints.of_head[heads.second] += joint.agreeing;
      break;
    }
  }
  return joints;
}

PairStart place_from(std::size_t first, const std::vector<Matrix3d>& R, const Joints& joints) {
  PairStart start{first, std::vector<std::optional<Matrix3d>>(R.size()), joints.agreeing};
  auto& placed = start.R_head_rig;
  placed[first] = R[first];
  for (;;) {
    const Joint* best = nullptr;
    std::size_t a = 0, b = 0;
    for (const auto& [heads, joint] : joints.by_heads) {
      if (placed[heads.first].has_value() == placed[heads.second].has_value()) continue;
      if (best != nullptr && joint.trust <= best->trust) continue;
      best = &joint;
      std::tie(a, b) = heads;
    }
    if (best == nullptr) return start;
    if (placed[a]) {
      placed[b] = best->R_b_a * *placed[a];
    } else {
      placed[a] = best->R_b_a.transpose() * *placed[b];
    }
  }
}

}  // namespace

PairStart start_from_pairs(const std::vector<Matrix3d>& R, const std::vector<RayPair>& pairs, const PairRules& rules) {
  const Joints joints = find_joints(R.size(), pairs, rules);
  const auto first = static_cast<std::size_t>(std::ranges::max_element(joints.of_head) - joints.of_head.begin());
  return place_from(first, R, joints);
}

std::vector<PairStart> islands_from_pairs(const std::vector<Matrix3d>& R, const std::vector<RayPair>& pairs) {
  const Joints joints = find_joints(R.size(), pairs, {});
  std::vector<PairStart> islands;
  std::vector<bool> placed(R.size());
  for (std::size_t h = 0; h < R.size(); ++h) {
    if (placed[h]) continue;
    islands.push_back(place_from(h, R, joints));
    for (std::size_t k = 0; k < R.size(); ++k) placed[k] = placed[k] || islands.back().R_head_rig[k].has_value();
  }
  return islands;
}

}  // namespace nodal::registration
