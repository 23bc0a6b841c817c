// The objective's inner loops over one tile of rays, in single precision and wide registers.
#pragma once

#include <array>
#include <vector>

#include "stitch/registration/head_state.h"

namespace nodal::registration {

inline constexpr int kTile = 128;

/// Rays that lie together, rig frame. Places past the last ray repeat it with no solid angle.
struct alignas(64) Tile {
  float x[kTile], y[kTile], z[kTile];
  float omega[kTile];            ///< sr
  float axis[3] = {0, 0, 1};
  float cos_radius = 1, sin_radius = 0;  ///< every ray is that near to the axis
};

/// One picture of a head at one level of its pyramid, relative light in 8-bit levels (0..255).
struct PlaneRef {
  const float* values = nullptr;
  int width = 0, height = 0;
};

/// One head as the kernel reads it, of one state and one level.
struct HeadSight {
  float R[9];                    ///< rig to head
  const RadialTable* table = nullptr;
  float center_x, center_y, aspect;
  float left, top, right, bottom;        ///< of the region, drawn in so that every tap is good
  float circle_x, circle_y, circle_radius2;
  float vignetting_x, vignetting_y, per_vignetting_radius2, vignetting[3];
  float gain[3];
  float level_scale;             ///< full-size pixels a level pixel
  int width = 0, height = 0;     ///< of the level
  float axis[3];                 ///< in the rig
  float cos_reach, sin_reach;    ///< how far from its axis it sees
  std::vector<PlaneRef> planes;  ///< frame sets times channels
  std::vector<int> channels;     ///< of each plane
};

/// What one head does on one tile. The kernel's memory, reused from tile to tile.
struct alignas(64) TileHead {
  float x[kTile], y[kTile], z[kTile];  ///< the rays in the head's frame
  float fraction[kTile];
  float q[kTile], dq_dz[kTile];
  float u[kTile], v[kTile];            ///< full-size px
  float weight[kTile];                 ///< density; 0 where the head does not see the ray
  float vignetting_s[kTile];
  float falloff[kTile];                ///< V
  float dlog_du[kTile], dlog_dv[kTile];  ///< of V, by the picture's px
  float fx[kTile], fy[kTile];
  float light[kTile], du[kTile], dv[kTile];  ///< du, dv: by px, gain and V divided out
  float error[kTile];                  ///< from the ray's mean
  float share[kTile];                  ///< w / W
  float active[kTile];                 ///< the weight its difference counts with
  float gu[kTile], gv[kTile];          ///< of light by the picture's px, aspect taken out, fall-off's share included
  float gradient[3][kTile];            ///< of light by the ray, rig frame
  float J[kMaxSlots][kTile];           ///< of light, by the head's slots
  float J_others[kMaxSlots][kTile];    ///< the same as the other heads on the ray see the light's gradient
  int cell[kTile];
  int offset[kTile];                   ///< of the upper left tap
  int head = 0;
};

/// Per ray of a tile, for one plane.
struct alignas(64) TileRays {
  float total[kTile];    ///< W, sum of weights
  float mean[kTile];
  float measure[kTile];  ///< omega, 0 where fewer than two heads see the ray
  float robust[kTile];   ///< Huber's factor
  float active_total[kTile], active_error[kTile];
  float cost[kTile];     ///< of the ray, Huber's, without measure
};

/// Whether a head may see anything of a tile.
bool may_see(const HeadSight& head, const Tile& tile);
/// Fills everything up to fx, fy and the taps. False when it sees none of the rays.
bool project(const HeadSight& head, const Tile& tile, TileHead& out);
/// Reads one plane: light, du, dv.
void sample(const HeadSight& head, int plane, TileHead& out);
/// Mean, errors, Huber's factors. `huber`: the difference, in levels, from which a ray counts less; 0: never.
/// Returns false when no ray is seen by two.
bool compare(TileHead* const* heads, int count, const Tile& tile, float huber, bool max_norm, TileRays& rays);
/// The derivatives of light by the slots, J.
void differentiate(const HeadSight& head, const Slots& slots, int channel, TileHead& out);
/// J_others, for all heads of a tile together. The noise in a head's own gradient, squared, makes curvature that is not
/// there; two heads' noise has nothing in common.
void differentiate_by_others(const std::vector<HeadSight>& sights, const std::vector<Slots>& slots,
                             TileHead* const* heads, int count);
using Rows = const float (*)[kTile];
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
  /// Of what the duller of the two says, levels.
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
