#include "stitch/mesh/raymesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "protocol/base/angles.h"

namespace nodal::mesh {
namespace {

using Eigen::Vector3d;

double sine_volume(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return a.normalized().dot((b - a).cross(c - a).normalized());
}

double solid_angle_of(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot((b - a).cross(c - a)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

std::uint32_t Welder::add(const Vector3d& point) {
  // A point within `same` is in one of the eight cells, twice as wide, around the nearest corner.
  Cell corner{};
  for (std::size_t k = 0; k < 3; ++k)
    corner[k] = static_cast<std::int64_t>(std::floor(point[static_cast<int>(k)] / (2 * same_) + 0.5));
  for (std::int64_t n = 0; n < 8; ++n) {
    const auto found = cells_.find({corner[0] - (n & 1), corner[1] - (n >> 1 & 1), corner[2] - (n >> 2)});
    if (found != cells_.end() && (points_[found->second] - point).norm() < same_) return found->second;
  }
  const auto index = static_cast<std::uint32_t>(points_.size());
  Cell own{};
  for (std::size_t k = 0; k < 3; ++k)
    own[k] = static_cast<std::int64_t>(std::floor(point[static_cast<int>(k)] / (2 * same_)));
  cells_.emplace(own, index);
  points_.push_back(point);
  return index;
}

Status check_raymesh(Raymesh& mesh) {
  const auto named = [](std::size_t k) { return fmt::format("triangle {}", k + 1); };
  double covered = 0;
  std::size_t inward = 0;
  for (const Raymesh::Triangle& t : mesh.triangles) {
    const double angle = solid_angle_of(mesh.point(t[0]), mesh.point(t[1]), mesh.point(t[2]));
    covered += std::abs(angle);
    inward += angle < 0 ? 1 : 0;
  }
  // Counter-clockwise as the nodal point sees it: the normal points at it.
  if (2 * inward < mesh.triangles.size()) {
    for (Raymesh::Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  }
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> edges;
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    const Raymesh::Triangle& t = mesh.triangles[k];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t a = mesh.vertices[t[c]].point, b = mesh.vertices[t[(c + 1) % 3]].point;
      const auto [at, fresh] = edges.emplace(std::pair(a, b), k);
      if (fresh && a != b) continue;
      return fail(Errc::kBadValue, named(k) + (a == b ? " has two corners at one place"
                                                      : " folds over, or runs around the other way than, " +
                                                            named(at->second) + ", which has the same edge"));
    }
    if (!(sine_volume(mesh.point(t[0]), mesh.point(t[1]), mesh.point(t[2])) < -1e-9)) {
      return fail(Errc::kBadValue, named(k) +
                                       " is seen from behind, or edge-on, from the nodal point (0, 0, 0); a raymesh "
                                       "is around it and hides no part of itself");
    }
  }
  if (covered > 4 * kPi + 1e-6)
    return fail(Errc::kBadValue, "the mesh goes around the nodal point more than once; give an envelope");
  return {};
}

double edge_ratio(const Raymesh& mesh) {
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (const Raymesh::Triangle& t : mesh.triangles) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double length = geometry::angle_between(geometry::Ray::towards(mesh.point(t[c])),
                                                    geometry::Ray::towards(mesh.point(t[(c + 1) % 3])));
      shortest = std::min(shortest, length), longest = std::max(longest, length);
    }
  }
  return longest / shortest;
}

}  // namespace nodal::mesh
