// Initial rotations of the heads from point pairs, without a prior: from combinations of two pairs that are consistent.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace nodal::registration {

/// Two heads' rays to one point of the scene, each in its head's own frame.
struct RayPair {
  std::size_t a = 0, b = 0;  ///< heads, a < b
  Eigen::Vector3d ray_a, ray_b;
};

/// R_head_rig of every head that pairs connect to `first`, whose rotation is R; nothing for the others. Connections
/// that most pairs agree on are used first.
std::vector<std::optional<Eigen::Matrix3d>> start_from_pairs(const std::vector<Eigen::Matrix3d>& R,
                                                             const std::vector<RayPair>& pairs, std::size_t first);

}  // namespace nodal::registration
