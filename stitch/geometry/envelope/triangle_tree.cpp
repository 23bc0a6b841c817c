#include "stitch/geometry/envelope/triangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace nodal::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kWider = 1e-9;  // rad

double middle_of(const TriangleTree::Triangle& triangle, int axis) {
  return triangle[0][axis] + triangle[1][axis] + triangle[2][axis];
}

std::optional<double> meets(const TriangleTree::Triangle& triangle, const Vector3d& from, const Vector3d& d) {
  const Vector3d a = triangle[0] - from, b = triangle[1] - from, c = triangle[2] - from;
  // Six times the volume of the tetrahedron to the eye; its sign says which side is seen.
  const double depth = a.dot((b - a).cross(c - a)), facing = std::copysign(1.0, depth);
  double towards = 0;  // the normal along the line, as the sum of the parts of the three edges
  const auto beside = [&](const Vector3d& p, const Vector3d& q) {
    const Vector3d plane = p.cross(q);
    const double side = facing * plane.dot(d);
    towards += side;
    return side >= -kWider * plane.norm();
  };
  if (!beside(a, b) || !beside(b, c) || !beside(c, a) || !(towards > 0)) return std::nullopt;
  return std::abs(depth) / towards;
}

}  // namespace

TriangleTree::TriangleTree(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
  order_.resize(triangles_.size());
  std::iota(order_.begin(), order_.end(), 0U);
  for (const Triangle& triangle : triangles_) {
    for (const Vector3d& corner : triangle) reach_ = std::max(reach_, corner.norm());
  }
  if (!triangles_.empty()) build(0, static_cast<std::uint32_t>(triangles_.size()));
}

void TriangleTree::build(std::uint32_t begin, std::uint32_t end) {
  Node node{Vector3d::Constant(std::numeric_limits<double>::infinity()),
            Vector3d::Constant(-std::numeric_limits<double>::infinity()), begin, end};
  for (std::uint32_t k = begin; k < end; ++k) {
    for (const Vector3d& corner : triangles_[order_[k]]) {
      node.least = node.least.cwiseMin(corner);
      node.most = node.most.cwiseMax(corner);
    }
  }
  const std::size_t own = nodes_.size();
  nodes_.push_back(node);
  if (end - begin <= kLeaf) return;
  int axis = 0;
  (node.most - node.least).maxCoeff(&axis);
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     return middle_of(triangles_[a], axis) < middle_of(triangles_[b], axis);
                   });
  build(begin, middle);
  nodes_[own].right = static_cast<std::uint32_t>(nodes_.size());
  build(middle, end);
}

std::optional<TriangleTree::Hit> TriangleTree::first_hit(const Vector3d& from, const Vector3d& direction) const {
  std::optional<Hit> best;
  const double margin = 2 * kWider * (reach_ + from.norm());
  const auto passes = [&](const Node& node) {
    double enters = 0, leaves = best ? best->at : std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      const double low = node.least[k] - margin - from[k], high = node.most[k] + margin - from[k];
      if (direction[k] == 0) {
        if (low > 0 || high < 0) return false;
        continue;
      }
      const double one = low / direction[k], other = high / direction[k];
      enters = std::max(enters, std::min(one, other));
      leaves = std::min(leaves, std::max(one, other));
    }
    return enters <= leaves;
  };
  std::array<std::uint32_t, 64> waiting{};  // one a level, and a level halves
  std::size_t count = nodes_.empty() ? 0 : 1;
  while (count > 0) {
    const std::uint32_t at = waiting[--count];
    const Node& node = nodes_[at];
    if (!passes(node)) continue;
    if (node.right != 0) {
      waiting[count++] = node.right;
      waiting[count++] = at + 1;
      continue;
    }
    for (std::uint32_t k = node.begin; k < node.end; ++k) {
      const std::optional<double> hit = meets(triangles_[order_[k]], from, direction);
      if (hit && (!best || *hit < best->at)) best = Hit{*hit, order_[k]};
    }
  }
  return best;
}

}  // namespace nodal::geometry
