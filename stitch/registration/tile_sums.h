// A tile's contribution to the objective's sums.
#pragma once

#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// Adds the sum of weight * A B^T, over the first Ka and Kb rows, to a block with rows of length `stride`.
void add_block(Rows A, int Ka, Rows B, int Kb, const float* weight, int stride, double* block);
/// Adds the sum of weight * J_a.
void add_gradient(const TileHead& a, const float* weight, int K, double* gradient);
/// The weight of a pair of heads in the normal equations: the second derivative of the cost by their lights.
void pair_weight(const TileHead& a, const TileHead& b, bool same, const TileRays& rays, float* weight);
/// The weight of a head's light in the gradient.
void gradient_weight(const TileHead& a, const TileRays& rays, float* weight);
/// Sums over rays of measure * w_a w_b / W times ...
struct PairSums {
  double measure = 0;             ///< ... one
  double solid_angle = 0;         ///< solid angle that both heads see, sr, times the number of planes
  double difference = 0;          ///< ... (l_a - l_b)^2
  double aa = 0, ab = 0, bb = 0;  ///< ... l_a^2, l_a l_b, l_b^2
  /// Rms difference, levels.
  double rms() const;
  /// Rms detail of the head that has less, levels.
  double least_rms() const;
  /// Correlation about zero: 1 if the two are equal up to a factor, 0 if nothing is shared.
  double correlation() const;
  void add(const PairSums& other);
};
void add_pair(const TileHead& a, const TileHead& b, const TileRays& rays, PairSums& sums);
/// The solid angle of the rays that the head shares.
double shared_solid_angle(const TileHead& head, const TileRays& rays);
/// Adds measure * cost and measure * W.
void add_cost(const TileRays& rays, double* cost, double* weight);

}  // namespace nodal::registration
