// Finds the triangle that a line meets first.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace nodal::geometry {

/// A tree of boxes around triangles, each node with half of its parent's.
///
/// Threading: immutable; any thread.
class TriangleTree {
 public:
  using Triangle = std::array<Eigen::Vector3d, 3>;
  struct Hit {
    double at = 0;         ///< as a multiple of the direction
    std::size_t triangle;  ///< its index in the list
  };

  TriangleTree() = default;
  explicit TriangleTree(std::vector<Triangle> triangles);

  /// The first triangle ahead. `direction` is a unit vector. Triangles are 1e-9 rad wider than they are, as seen from
  /// `from`, so that no line passes between two of them.
  std::optional<Hit> first_hit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const;
  const std::vector<Triangle>& triangles() const { return triangles_; }
  /// How far the farthest corner is from the origin.
  double reach() const { return reach_; }

 private:
  static constexpr std::uint32_t kLeaf = 4;  ///< largest number of triangles in a leaf
  struct Node {
    Eigen::Vector3d least, most;
    std::uint32_t begin = 0, end = 0;  ///< range of order_
    std::uint32_t right = 0;           ///< the second child; the first follows its parent. 0: a leaf
  };
  void build(std::uint32_t begin, std::uint32_t end);

  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
  double reach_ = 0;
};

}  // namespace nodal::geometry
