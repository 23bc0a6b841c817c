// Initial rotations of the heads from point pairs, without a prior: from combinations of two pairs that are consistent.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

namespace nodal::registration {

/// Two heads' rays to one point of the scene, each in its head's own frame.
struct RayPair {
  std::size_t a = 0, b = 0;  ///< heads, a < b
  Eigen::Vector3d ray_a, ray_b;
};

/// When two heads count as connected.
struct PairRules {
  double tolerance = 1.5 * std::numbers::pi / 180;  ///< largest angle between a pair's two rays, rad
  int least = 2;                                    ///< smallest number of pairs that agree
  double least_share = 0;                           ///< smallest share of the two heads' pairs that agree
  /// How much a connection with this rotation is to be trusted, 0: not at all, and other pairs are tried. The most
  /// trusted connections are used first. Empty: trust is the number of pairs that agree.
  std::function<double(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a)> trust{};
};

struct PairStart {
  std::size_t first = 0;
  std::vector<std::optional<Eigen::Matrix3d>> R_head_rig;  ///< nothing for heads that no pairs connect to the first one
  int agreeing = 0;                                        ///< pairs that agree, of all connections, used or not
};

/// The rotation of every head that pairs connect to the first one, whose rotation is R: the head with the most pairs
/// that agree. The most trusted connections are used first. The time is proportional to the number of pairs.
PairStart start_from_pairs(const std::vector<Eigen::Matrix3d>& R, const std::vector<RayPair>& pairs,
                           const PairRules& rules = {});

/// The same for every group of connected heads; the first head of a group keeps its R. A head that no pairs connect is
/// a group of its own.
std::vector<PairStart> islands_from_pairs(const std::vector<Eigen::Matrix3d>& R, const std::vector<RayPair>& pairs);

}  // namespace nodal::registration
