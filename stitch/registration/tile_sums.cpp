#include "stitch/registration/tile_sums.h"

#include <algorithm>
#include <cmath>

#include "stitch/registration/wide.h"

namespace nodal::registration {
namespace {

// Adds lanes in a fixed tree, so that every register width adds in the same order. Rows are added side by side.
template <int kRows>
[[gnu::always_inline]] inline void sum_rows(float (*__restrict lanes)[kLanes], float* __restrict sums) {
  static_assert(kLanes == 16);
  for (int r = 0; r < kRows; ++r) {
    for (int i = 0; i < 8; ++i) lanes[r][i] += lanes[r][i + 8];
    for (int i = 0; i < 4; ++i) lanes[r][i] += lanes[r][i + 4];
  }
  for (int r = 0; r < kRows; ++r) sums[r] = (lanes[r][0] + lanes[r][2]) + (lanes[r][1] + lanes[r][3]);
}

[[gnu::always_inline]] inline double sum_lanes(float* lanes) {
  float sum = 0;
  sum_rows<1>(reinterpret_cast<float(*)[kLanes]>(lanes), &sum);
  return static_cast<double>(sum);
}

}  // namespace

NODAL_WIDE
void add_block(Rows A, int Ka, Rows B, int Kb, const float* weight, int stride, double* block) {
  constexpr int kRows = 4;
  alignas(64) float weighted[kTile];
  for (int k = 0; k < Ka; ++k) {
    for (int i = 0; i < kTile; ++i) weighted[i] = weight[i] * A[k][i];
    for (int first = 0; first < Kb; first += kRows) {
      // The last rows may be those of no slot; their sums are not used.
      alignas(64) float lanes[kRows][kLanes] = {};
      float sums[kRows];
      for (int r = 0; r < kRows && first + r < Kb; ++r) {
        for (int i = 0; i < kTile; i += kLanes) {
          for (int l = 0; l < kLanes; ++l) lanes[r][l] += weighted[i + l] * B[first + r][i + l];
        }
      }
      sum_rows<kRows>(lanes, sums);
      for (int r = 0; r < kRows && first + r < Kb; ++r) block[k * stride + first + r] += static_cast<double>(sums[r]);
    }
  }
}

NODAL_WIDE
void add_gradient(const TileHead& a, const float* weight, int K, double* gradient) {
  for (int k = 0; k < K; ++k) {
    alignas(64) float lanes[kLanes] = {};
    for (int i = 0; i < kTile; i += kLanes) {
      for (int l = 0; l < kLanes; ++l) lanes[l] += weight[i + l] * a.J[k][i + l];
    }
    gradient[k] += sum_lanes(lanes);
  }
}

NODAL_WIDE
void pair_weight(const TileHead& a, const TileHead& b, bool same, const TileRays& rays, float* weight) {
  const float own = same ? 1.0F : 0.0F;
  for (int i = 0; i < kTile; ++i) {
    const float pa = a.share[i], pb = b.share[i];
    weight[i] = rays.measure[i] * rays.robust[i] *
                (own * a.active[i] - pb * a.active[i] - pa * b.active[i] + pa * pb * rays.active_total[i]);
  }
}

NODAL_WIDE
void gradient_weight(const TileHead& a, const TileRays& rays, float* weight) {
  for (int i = 0; i < kTile; ++i) {
    weight[i] = rays.measure[i] * rays.robust[i] * (a.active[i] * a.error[i] - a.share[i] * rays.active_error[i]);
  }
}

double PairSums::rms() const { return measure > 0 ? std::sqrt(difference / measure) : 0; }

double PairSums::least_rms() const { return measure > 0 ? std::sqrt(std::min(aa, bb) / measure) : 0; }

double PairSums::correlation() const { return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0; }

void PairSums::add(const PairSums& other) {
  measure += other.measure;
  solid_angle += other.solid_angle;
  difference += other.difference;
  aa += other.aa;
  ab += other.ab;
  bb += other.bb;
}

NODAL_WIDE
void add_pair(const TileHead& a, const TileHead& b, const TileRays& rays, PairSums& sums) {
  alignas(64) float measure[kLanes] = {}, angle[kLanes] = {}, difference[kLanes] = {}, aa[kLanes] = {}, ab[kLanes] = {},
                    bb[kLanes] = {};
  for (int i = 0; i < kTile; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) {
      const int k = i + l;
      const float w = rays.measure[k] * a.share[k] * b.weight[k], la = a.light[k], lb = b.light[k], d = la - lb;
      measure[l] += w;
      angle[l] += w > 0 ? rays.measure[k] : 0.0F;
      difference[l] += w * d * d;
      aa[l] += w * la * la;
      ab[l] += w * la * lb;
      bb[l] += w * lb * lb;
    }
  }
  sums.add({sum_lanes(measure), sum_lanes(angle), sum_lanes(difference), sum_lanes(aa), sum_lanes(ab), sum_lanes(bb)});
}

NODAL_WIDE
double shared_solid_angle(const TileHead& head, const TileRays& rays) {
  alignas(64) float angle[kLanes] = {};
  for (int i = 0; i < kTile; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) angle[l] += head.weight[i + l] > 0 ? rays.measure[i + l] : 0.0F;
  }
  return sum_lanes(angle);
}

NODAL_WIDE
void add_cost(const TileRays& rays, double* cost, double* weight) {
  alignas(64) float costs[kLanes] = {}, weights[kLanes] = {};
  for (int i = 0; i < kTile; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) {
      costs[l] += rays.measure[i + l] * rays.cost[i + l];
      weights[l] += rays.measure[i + l] * rays.total[i + l];
    }
  }
  *cost += sum_lanes(costs);
  *weight += sum_lanes(weights);
}

}  // namespace nodal::registration
