// A tile's contribution to the objective's sums.
#pragma once

#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// Adds to a block of which a row is `stride` long: sum of weight * A B^T over the first Ka and Kb rows.
void add_block(Rows A, int Ka, Rows B, int Kb, const float* weight, int stride, double* block);
/// Adds sum of weight * J_a.
void add_gradient(const TileHead& a, const float* weight, int K, double* gradient);
/// Weight of a pair of heads in the normal equations: d2(cost) with respect to their lights.
void pair_weight(const TileHead& a, const TileHead& b, bool same, const TileRays& rays, float* weight);
/// Weight of a head's light in the gradient.
void gradient_weight(const TileHead& a, const TileRays& rays, float* weight);
/// Sums over rays of measure * w_a w_b / W times ...
struct PairSums {
  double measure = 0;             ///< ... one
  double solid_angle = 0;         ///< that both see, sr; times the planes
  double difference = 0;          ///< ... (l_a - l_b)^2
  double aa = 0, ab = 0, bb = 0;  ///< ... l_a^2, l_a l_b, l_b^2
  /// In levels.
  double rms() const;
  /// The detail of the head with less of it, levels.
  double least_rms() const;
  /// Correlation about zero: 1 when the two are the same up to a factor. 0 when nothing is shared.
  double correlation() const;
  void add(const PairSums& other);
};
void add_pair(const TileHead& a, const TileHead& b, const TileRays& rays, PairSums& sums);
/// Solid angle of the rays that the head shares.
double shared_solid_angle(const TileHead& head, const TileRays& rays);
/// Adds measure * cost and measure * W.
void add_cost(const TileRays& rays, double* cost, double* weight);

}  // namespace nodal::registration
