// The objective's inner loops over one tile of rays, in single precision and wide registers.
#pragma once

#include <array>
#include <vector>

#include "stitch/registration/head_state.h"

namespace nodal::registration {

inline constexpr int kTile = 128;

/// Neighbouring rays, in the rig frame. Unused places repeat the last ray with solid angle 0.
struct alignas(64) Tile {
  float x[kTile], y[kTile], z[kTile];
  float omega[kTile];  ///< sr
  float axis[3] = {0, 0, 1};
  /// Cosine and sine of the radius of a cone about the axis that contains all rays.
  float cos_radius = 1, sin_radius = 0;
};

/// One picture of a head at one level of its pyramid, relative light in 8-bit levels (0..255).
struct PlaneRef {
  const float* values = nullptr;
  int width = 0, height = 0;
};

/// One head as the kernel reads it, for one state and one level.
struct HeadSight {
  float R[9];                     ///< rig to head
  float position[3] = {0, 0, 0};  ///< m, in the head's frame
  float nearness = 0;             ///< 1/m
  const RadialTable* table = nullptr;
  float center_x, center_y, aspect;
  float left, top, right, bottom;  ///< bounds of the region, reduced so that every tap is inside
  float circle_x, circle_y, circle_radius2;
  const MaskField* masks = nullptr;  ///< null if nothing is masked
  float mask_margin = 0;             ///< full-size px
  float vignetting_x, vignetting_y, per_vignetting_radius2, vignetting[3];
  float gain[3];
  float level_scale;             ///< full-size pixels per pixel of the level
  int width = 0, height = 0;     ///< size of the level
  float axis[3];                 ///< the head's axis in the rig frame
  float cos_reach, sin_reach;    ///< cosine and sine of the largest angle from its axis that it sees
  std::vector<PlaneRef> planes;  ///< number of frame sets times channels
  std::vector<int> channels;     ///< channel of each plane
};

/// One head on one tile: the kernel's working memory, reused for every tile.
struct alignas(64) TileHead {
  float x[kTile], y[kTile], z[kTile];  ///< the rays as the head sees their ends, in its frame
  float per_range[kTile];              ///< distance over the range from the head; only at a finite distance
  float fraction[kTile];
  float q[kTile], dq_dz[kTile];
  float u[kTile], v[kTile];  ///< full-size px
  float weight[kTile];       ///< density; 0 where the head does not see the ray
  float vignetting_s[kTile];
  float falloff[kTile];                  ///< V
  float dlog_du[kTile], dlog_dv[kTile];  ///< derivatives of log V by the picture's px
  float fx[kTile], fy[kTile];
  float light[kTile], du[kTile], dv[kTile];  ///< du, dv: derivatives by px; all divided by gain and V
  float error[kTile];                        ///< from the ray's mean
  float share[kTile];                        ///< w / W
  float active[kTile];                       ///< the weight of its difference
  float gu[kTile], gv[kTile];        ///< derivatives of light by px without the aspect, including the fall-off's
  float gradient[3][kTile];          ///< gradient of light by the ray, in the rig frame
  float J[kMaxSlots][kTile];         ///< derivatives of light by the head's slots
  float J_others[kMaxSlots][kTile];  ///< the same with the light's gradient from the other heads on the ray
  int cell[kTile];
  int offset[kTile];  ///< index of the upper left tap
  int head = 0;
};
using Rows = const float (*)[kTile];

/// Values per ray of a tile, for one plane.
struct alignas(64) TileRays {
  float total[kTile];  ///< W, sum of weights
  float mean[kTile];
  float measure[kTile];  ///< omega; 0 where fewer than two heads see the ray
  float robust[kTile];   ///< Huber's factor
  float active_total[kTile], active_error[kTile];
  float cost[kTile];  ///< Huber's cost of the ray, without measure
};

/// Whether a head may see any ray of a tile.
bool may_see(const HeadSight& head, const Tile& tile);
/// Fills in the members up to fx, fy and the taps. False if the head sees none of the rays.
bool project(const HeadSight& head, const Tile& tile, TileHead& out);
/// Samples one plane: light, du, dv.
void sample(const HeadSight& head, int plane, TileHead& out);
/// Computes mean, errors and Huber's factors. `huber`: the difference, in levels, from which on a ray's weight
/// decreases; 0: never. Returns false if no ray is seen by two heads.
bool compare(TileHead* const* heads, int count, const Tile& tile, float huber, bool max_norm, TileRays& rays);
/// Computes J, the derivatives of light by the slots.
void differentiate(const HeadSight& head, const Slots& slots, int channel, TileHead& out);
/// Computes J_others, for all heads of a tile. A head's own gradient squared contains its noise squared, which adds
/// false curvature; the noise of two heads is independent.
void differentiate_by_others(const std::vector<HeadSight>& sights, const std::vector<Slots>& slots,
                             TileHead* const* heads, int count);

}  // namespace nodal::registration
