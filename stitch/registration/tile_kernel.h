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
  float omega[kTile];  ///< sr
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
  float R[9];  ///< rig to head
  const RadialTable* table = nullptr;
  float center_x, center_y, aspect;
  float left, top, right, bottom;  ///< of the region, drawn in so that every tap is good
  float circle_x, circle_y, circle_radius2;
  const MaskField* masks = nullptr;  ///< null where nothing is masked
  float mask_margin = 0;             ///< full-size px
  float vignetting_x, vignetting_y, per_vignetting_radius2, vignetting[3];
  float gain[3];
  float level_scale;             ///< full-size pixels a level pixel
  int width = 0, height = 0;     ///< of the level
  float axis[3];                 ///< in the rig
  float cos_reach, sin_reach;    ///< the angle from its axis up to which it sees
  std::vector<PlaneRef> planes;  ///< frame sets times channels
  std::vector<int> channels;     ///< of each plane
};

/// One head on one tile: the kernel's memory, reused from tile to tile.
struct alignas(64) TileHead {
  float x[kTile], y[kTile], z[kTile];  ///< the rays in the head's frame
  float fraction[kTile];
  float q[kTile], dq_dz[kTile];
  float u[kTile], v[kTile];  ///< full-size px
  float weight[kTile];       ///< density; 0 where the head does not see the ray
  float vignetting_s[kTile];
  float falloff[kTile];                  ///< V
  float dlog_du[kTile], dlog_dv[kTile];  ///< of V, by the picture's px
  float fx[kTile], fy[kTile];
  float light[kTile], du[kTile], dv[kTile];  ///< du, dv: by px, gain and V divided out
  float error[kTile];                        ///< from the ray's mean
  float share[kTile];                        ///< w / W
  float active[kTile];                       ///< the weight its difference counts with
  float gu[kTile], gv[kTile];        ///< of light by the picture's px, aspect taken out, fall-off's share included
  float gradient[3][kTile];          ///< of light by the ray, rig frame
  float J[kMaxSlots][kTile];         ///< of light, by the head's slots
  float J_others[kMaxSlots][kTile];  ///< the same as the other heads on the ray see the light's gradient
  int cell[kTile];
  int offset[kTile];  ///< of the upper left tap
  int head = 0;
};
using Rows = const float (*)[kTile];

/// Per ray of a tile, for one plane.
struct alignas(64) TileRays {
  float total[kTile];  ///< W, sum of weights
  float mean[kTile];
  float measure[kTile];  ///< omega, 0 where fewer than two heads see the ray
  float robust[kTile];   ///< Huber's factor
  float active_total[kTile], active_error[kTile];
  float cost[kTile];  ///< of the ray, Huber's, without measure
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

}  // namespace nodal::registration
