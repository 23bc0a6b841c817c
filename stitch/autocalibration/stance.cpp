#include "stitch/autocalibration/stance.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "protocol/base/angles.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Largest difference between a head's angle to the ring's axis and that of the ring.
constexpr double kFlat = 3 * kRadiansPerDegree;
constexpr double kAlongAxis = 30 * kRadiansPerDegree;  // a head that is closer to the axis does not belong to the ring
// Sine of the largest pitch of a ring's heads: pictures of an arc are on a steep cone by chance.
constexpr double kSteepest = 0.65;
constexpr double kSameAxis = 10 * kRadiansPerDegree;  // two rings whose axes differ by less have the same axis
constexpr double kOneSided = 0.4;     // largest length of the mean axis of a ring's heads, across the ring's axis
constexpr double kOnTheirSide = 0.3;  // mean upward component below which pictures lie on their side
constexpr double kRollSigma = 5;      // degrees, of how heads are held
constexpr double kPitchSigma = 25;    // degrees; people look up and down
constexpr double kHeldAlike = 0.5;    // least mean upward component of heads that are held upright
// The largest roll and pitch of a picture that agrees with a group's up.
constexpr double kMaxRoll = 15 * kRadiansPerDegree, kMaxPitch = 60 * kRadiansPerDegree;

/// The heads on the cone about `axis` with this cosine.
std::vector<std::size_t> on_cone(const std::vector<HeldHead>& heads, const Vector3d& axis, double cosine) {
  std::vector<std::size_t> found;
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const double own = std::acos(std::clamp(heads[h].forward.dot(axis), -1.0, 1.0));
    if (std::abs(own - angle) < kFlat) found.push_back(h);
  }
  return found;
}

bool is_ring(const std::vector<HeldHead>& heads, const std::vector<std::size_t>& members, const Vector3d& axis) {
  Vector3d mean = Vector3d::Zero();
  for (const std::size_t h : members) mean += heads[h].forward / static_cast<double>(members.size());
  mean -= mean.dot(axis) * axis;
  if (mean.norm() > kOneSided) return false;
  // All others look along the axis.
  return std::ranges::all_of(heads, [&](const HeldHead& head) {
    const std::size_t h = static_cast<std::size_t>(&head - heads.data());
    return std::ranges::find(members, h) != members.end() || std::abs(head.forward.dot(axis)) > std::cos(kAlongAxis);
  });
}

struct Ring {
  Vector3d axis;
  std::size_t members = 0;
};

/// The axis that fits the members best: where their axes vary least about their mean, or about a right angle.
Vector3d fitted_axis(const std::vector<HeldHead>& heads, const std::vector<std::size_t>& members, bool cone,
                     const Vector3d& near) {
  Vector3d mean = Vector3d::Zero();
  for (const std::size_t h : members) mean += heads[h].forward / static_cast<double>(members.size());
  Matrix3d sum = Matrix3d::Zero();
  for (const std::size_t h : members) {
    const Vector3d off = heads[h].forward - (cone ? mean : Vector3d::Zero());
    sum += off * off.transpose();
  }
  const Vector3d axis = Eigen::SelfAdjointEigenSolver<Matrix3d>(sum).eigenvectors().col(0);
  return axis.dot(near) < 0 ? Vector3d(-axis) : axis;
}

}  // namespace

std::optional<Vector3d> ring_up(const std::vector<HeldHead>& heads, const Vector3d& light) {
  std::vector<Ring> rings;
  const auto consider = [&](const Vector3d& normal, const HeldHead& one, bool cone) {
    if (normal.norm() < std::sin(kFlat)) return;
    const Vector3d axis = normal.normalized();
    if (cone && std::abs(one.forward.dot(axis)) > kSteepest) return;
    const std::vector<std::size_t> members = on_cone(heads, axis, cone ? one.forward.dot(axis) : 0);
    if (members.size() < (cone ? 4U : 3U) || !is_ring(heads, members, axis)) return;
    rings.push_back({fitted_axis(heads, members, cone, axis), members.size()});
  };
  for (std::size_t i = 0; i < heads.size(); ++i) {
    for (std::size_t j = i + 1; j < heads.size(); ++j) {
      const Vector3d side = heads[j].forward - heads[i].forward;
      consider(heads[i].forward.cross(heads[j].forward), heads[i], false);
      for (std::size_t k = j + 1; k < heads.size(); ++k) {
        consider(side.cross(heads[k].forward - heads[i].forward), heads[i], true);
      }
    }
  }
  if (rings.empty()) return std::nullopt;
  const Ring best = *std::ranges::max_element(rings, {}, &Ring::members);
  for (const Ring& other : rings) {
    const bool same = std::abs(other.axis.dot(best.axis)) > std::cos(kSameAxis);
    if (!same && other.members == best.members) return std::nullopt;
  }
  double upwards = 0;
  for (const HeldHead& head : heads) upwards += head.up.dot(best.axis) / static_cast<double>(heads.size());
  if (std::abs(upwards) < kOnTheirSide) upwards = light.dot(best.axis);
  return upwards < 0 ? Vector3d(-best.axis) : best.axis;
}

std::optional<Vector3d> held_up(const std::vector<HeldHead>& heads) {
  Vector3d mean = Vector3d::Zero();
  Matrix3d against = Matrix3d::Zero();
  for (const HeldHead& head : heads) {
    const Vector3d right = head.forward.cross(head.up);
    against += right * right.transpose() / (kRollSigma * kRollSigma) +
               head.forward * head.forward.transpose() / (kPitchSigma * kPitchSigma);
    mean += head.up / static_cast<double>(heads.size());
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(against);
  Vector3d up = solver.eigenvectors().col(0);
  if (up.dot(mean) < 0) up = -up;
  const bool upright = std::ranges::all_of(heads, [&](const HeldHead& head) { return head.up.dot(up) > 0; });
  if (!upright || mean.dot(up) < kHeldAlike) return std::nullopt;
  return up;
}

std::optional<Vector3d> mostly_held_up(const std::vector<HeldHead>& heads) {
  std::vector<HeldHead> largest;
  const auto consider = [&](const Vector3d& up) {
    std::vector<HeldHead> group;
    std::ranges::copy_if(heads, std::back_inserter(group), [&](const HeldHead& head) {
      return std::abs(head.forward.cross(head.up).dot(up)) < std::sin(kMaxRoll) &&
             head.up.dot(up) > std::cos(kMaxPitch);
    });
    if (group.size() > largest.size()) largest = std::move(group);
  };
  for (std::size_t i = 0; i < heads.size(); ++i) {
    consider(heads[i].up);
    // Heads that look up or down all have rows at right angles to the same direction.
    for (std::size_t j = i + 1; j < heads.size(); ++j) {
      const Vector3d normal = heads[i].forward.cross(heads[i].up).cross(heads[j].forward.cross(heads[j].up));
      if (normal.norm() < std::sin(kMaxRoll)) continue;
      const Vector3d up = normal.normalized();
      consider(up.dot(heads[i].up) < 0 ? Vector3d(-up) : up);
    }
  }
  if (2 * largest.size() <= heads.size()) return std::nullopt;
  return held_up(largest);
}

}  // namespace nodal::autocalibration
