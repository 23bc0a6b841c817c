#include "stitch/registration/tile_kernel.h"

#include <algorithm>
#include <cmath>

#include "stitch/registration/wide.h"

#define NODAL_INLINE [[gnu::always_inline]] inline

namespace nodal::registration {
namespace {

NODAL_INLINE bool any(const float* __restrict values) {
  alignas(64) float most[kLanes] = {};
  for (int i = 0; i < kTile; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) most[l] = std::max(most[l], values[i + l]);
  }
  float all = 0;
  for (const float each : most) all = std::max(all, each);
  return all > 0;
}

// Four values per lane: a cell's two nodes, or a pixel's four neighbours.
struct Four {
  const float* __restrict a;
  const float* __restrict b;
  const float* __restrict c;
  const float* __restrict d;
};

// From the rays' ends as seen from the rig's nodal point to the directions from the head.
NODAL_INLINE void leave_nodal_point(const HeadSight& head, TileHead& __restrict out) {
  const float px = head.position[0] * head.nearness, py = head.position[1] * head.nearness,
              pz = head.position[2] * head.nearness;
  for (int i = 0; i < kTile; ++i) {
    const float x = out.x[i] - px, y = out.y[i] - py, z = out.z[i] - pz;
    const float per_range = 1 / std::sqrt(x * x + y * y + z * z);
    out.per_range[i] = per_range;
    out.x[i] = x * per_range;
    out.y[i] = y * per_range;
    out.z[i] = z * per_range;
  }
}

// Computes the rays in the head's frame, and their positions in the radial table.
NODAL_INLINE void turn(const HeadSight& head, const Tile& __restrict tile, float* __restrict t,
                       TileHead& __restrict out) {
  const float r0 = head.R[0], r1 = head.R[1], r2 = head.R[2], r3 = head.R[3], r4 = head.R[4], r5 = head.R[5],
              r6 = head.R[6], r7 = head.R[7], r8 = head.R[8];
  const float per_t = head.table->cells_per_t(), max_t = head.table->max_t();
  for (int i = 0; i < kTile; ++i) {
    const float x = tile.x[i], y = tile.y[i], z = tile.z[i];
    out.x[i] = r0 * x + r1 * y + r2 * z;
    out.y[i] = r3 * x + r4 * y + r5 * z;
    out.z[i] = r6 * x + r7 * y + r8 * z;
  }
  if (head.nearness > 0) leave_nodal_point(head, out);
  for (int i = 0; i < kTile; ++i) {
    const float t2 = 0.5F - 0.5F * out.z[i];
    t[i] = std::sqrt(t2 > 1e-12F ? t2 : 1e-12F);
    const float place = (t[i] < max_t ? t[i] : max_t) * per_t;
    const int cell = static_cast<int>(place);
    out.cell[i] = cell;
    out.fraction[i] = place - static_cast<float>(cell);
  }
}

// Computes the rays' pixels by Hermite interpolation between two nodes of the table; dz = -4 t dt.
NODAL_INLINE void bend(const HeadSight& head, const float* __restrict t, const Four& nodes, TileHead& __restrict out) {
  const float center_x = head.center_x, center_y = head.center_y, aspect = head.aspect;
  const float per_4 = head.table->cells_per_t() / 4;
  for (int i = 0; i < kTile; ++i) {
    const float f = out.fraction[i], q0 = nodes.a[i], s0 = nodes.b[i], s1 = nodes.d[i], rise = nodes.c[i] - q0;
    const float c2 = 3 * rise - 2 * s0 - s1, c3 = s0 + s1 - 2 * rise;
    const float q = q0 + f * (s0 + f * (c2 + f * c3));
    out.q[i] = q;
    out.dq_dz[i] = -(s0 + f * (2 * c2 + 3 * f * c3)) * per_4 / t[i];
    out.u[i] = center_x + q * out.x[i];
    out.v[i] = center_y + aspect * q * out.y[i];
  }
}

// Sets the weight of rays that the head does not see to 0. False if it sees none.
NODAL_INLINE bool clip(const HeadSight& head, const float* __restrict t, TileHead& __restrict out) {
  const float max_t = head.table->max_t(), aspect = head.aspect, left = head.left, right = head.right, top = head.top,
              bottom = head.bottom, circle_x = head.circle_x, circle_y = head.circle_y,
              circle_radius2 = head.circle_radius2;
  for (int i = 0; i < kTile; ++i) {
    const float u = out.u[i], v = out.v[i], cx = u - circle_x, cy = v - circle_y;
    // A distance from the edges in any unit: only its sign is used.
    float inside = max_t - t[i];
    inside = std::min(inside, std::min(u - left, right - u));
    inside = std::min(inside, std::min(v - top, bottom - v));
    inside = std::min(inside, circle_radius2 - (cx * cx + cy * cy));
    out.weight[i] = inside >= 0 ? out.weight[i] * aspect : 0.0F;
  }
  if (head.masks != nullptr) {
    for (int i = 0; i < kTile; ++i) {
      if (out.weight[i] > 0 && head.masks->hides(out.u[i], out.v[i], head.mask_margin)) out.weight[i] = 0;
    }
  }
  return any(out.weight);
}

NODAL_INLINE void fall_off(const HeadSight& head, TileHead& __restrict out) {
  const float x = head.vignetting_x, y = head.vignetting_y, per_r2 = head.per_vignetting_radius2,
              v1 = head.vignetting[0], v2 = head.vignetting[1], v3 = head.vignetting[2], per_aspect = 1 / head.aspect;
  for (int i = 0; i < kTile; ++i) {
    const float dx = out.u[i] - x, dy = (out.v[i] - y) * per_aspect;
    const float s = (dx * dx + dy * dy) * per_r2;
    const float V = 1 + s * (v1 + s * (v2 + s * v3));
    const float safe = V > 0.05F ? V : 0.05F;
    const float slope = 2 * per_r2 * (v1 + s * (2 * v2 + s * 3 * v3)) / safe;
    out.vignetting_s[i] = s;
    out.falloff[i] = safe;
    out.dlog_du[i] = slope * dx;
    out.dlog_dv[i] = slope * dy * per_aspect;
  }
}

NODAL_INLINE void find_taps(const HeadSight& head, TileHead& __restrict out) {
  const float per_scale = 1 / head.level_scale;
  const float last_x = static_cast<float>(head.width - 2), last_y = static_cast<float>(head.height - 2);
  const int width = head.width;
  for (int i = 0; i < kTile; ++i) {
    const float x = out.u[i] * per_scale - 0.5F, y = out.v[i] * per_scale - 0.5F;
    const float x0 = std::min(std::max(x, 0.0F), last_x), y0 = std::min(std::max(y, 0.0F), last_y);
    const int ix = static_cast<int>(x0), iy = static_cast<int>(y0);
    out.fx[i] = x - static_cast<float>(ix);
    out.fy[i] = y - static_cast<float>(iy);
    out.offset[i] = iy * width + ix;
  }
}

NODAL_INLINE void interpolate(const Four& taps, float per_gain, float per_scale, TileHead& __restrict out) {
  for (int i = 0; i < kTile; ++i) {
    const float fx = out.fx[i], fy = out.fy[i], l00 = taps.a[i], l01 = taps.c[i];
    const float scale = per_gain / out.falloff[i];
    const float across_top = taps.b[i] - l00, across_bottom = taps.d[i] - l01;
    const float top = l00 + fx * across_top, bottom = l01 + fx * across_bottom;
    out.light[i] = scale * (top + fy * (bottom - top));
    out.du[i] = scale * per_scale * (across_top + fy * (across_bottom - across_top));
    out.dv[i] = scale * per_scale * (bottom - top);
  }
}

// The derivative by a shift of the picture: its own gradient, and the fall-off, which does not shift.
NODAL_INLINE void full_gradient(const HeadSight& head, TileHead& __restrict out) {
  const float aspect = head.aspect;
  for (int i = 0; i < kTile; ++i) {
    out.gu[i] = out.du[i] - out.light[i] * out.dlog_du[i];
    out.gv[i] = (out.dv[i] - out.light[i] * out.dlog_dv[i]) * aspect;
  }
}

using RowsOut = float (*)[kTile];

NODAL_INLINE void by_rotation(const TileHead& in, const float* __restrict gu, const float* __restrict gv,
                              float* __restrict jx, float* __restrict jy, float* __restrict jz) {
  for (int i = 0; i < kTile; ++i) {
    // A turn w moves the ray by w x d, so the light changes by w . (d x gradient).
    const float a = gu[i] * in.q[i], b = gv[i] * in.q[i];
    const float c = in.dq_dz[i] * (gu[i] * in.x[i] + gv[i] * in.y[i]);
    jx[i] = in.y[i] * c - in.z[i] * b;
    jy[i] = in.z[i] * a - in.x[i] * c;
    jz[i] = in.x[i] * b - in.y[i] * a;
  }
}

// With nearness the direction moves against the head's position, as far as that is across it.
NODAL_INLINE void by_nearness(const HeadSight& head, const TileHead& in, const float* __restrict gu,
                              const float* __restrict gv, float* __restrict j) {
  const float px = head.position[0], py = head.position[1], pz = head.position[2];
  const bool finite = head.nearness > 0;
  for (int i = 0; i < kTile; ++i) {
    const float x = in.x[i], y = in.y[i], z = in.z[i];
    const float a = gu[i] * in.q[i], b = gv[i] * in.q[i], c = in.dq_dz[i] * (gu[i] * x + gv[i] * y);
    const float along = px * x + py * y + pz * z;
    const float change = a * (px - along * x) + b * (py - along * y) + c * (pz - along * z);
    j[i] = finite ? -change * in.per_range[i] : -change;
  }
}

NODAL_INLINE void by_geometry(const HeadSight& head, const Slots& slots, const TileHead& in, const float* gu,
                              const float* gv, RowsOut J) {
  if (slots.rotation >= 0) {
    by_rotation(in, gu, gv, J[slots.rotation], J[slots.rotation + 1], J[slots.rotation + 2]);
  }
  for (int k = 0; k < 1 + slots.radials && slots.focal >= 0; ++k) {
    const float* __restrict dq = head.table->derivative(k);
    float* __restrict j = J[k == 0 ? slots.focal : slots.radial + k - 1];
    for (int i = 0; i < kTile; ++i) {
      const float left = dq[in.cell[i]], right = dq[in.cell[i] + 1];
      j[i] = (left + in.fraction[i] * (right - left)) * (gu[i] * in.x[i] + gv[i] * in.y[i]);
    }
  }
  if (slots.nearness >= 0) by_nearness(head, in, gu, gv, J[slots.nearness]);
  // The fall-off moves with the centre and the aspect, so its part of the gradient is subtracted again.
  const float per_aspect = 1 / head.aspect;
  if (slots.aspect >= 0) {
    float* __restrict j = J[slots.aspect];
    for (int i = 0; i < kTile; ++i) j[i] = (gv[i] * per_aspect + in.light[i] * in.dlog_dv[i]) * in.q[i] * in.y[i];
  }
  if (slots.center >= 0) {
    float* __restrict ju = J[slots.center];
    float* __restrict jv = J[slots.center + 1];
    for (int i = 0; i < kTile; ++i) {
      ju[i] = gu[i] + in.light[i] * in.dlog_du[i];
      jv[i] = gv[i] * per_aspect + in.light[i] * in.dlog_dv[i];
    }
  }
}

NODAL_INLINE void by_radiometry(const Slots& slots, int channel, const TileHead& in, RowsOut J) {
  for (int c = 0; c < slots.gains; ++c) {
    float* __restrict j = J[slots.gain + c];
    const float mine = c == channel || slots.gains == 1 ? -1.0F : 0.0F;
    for (int i = 0; i < kTile; ++i) j[i] = mine * in.light[i];
  }
  if (slots.vignetting < 0) return;
  float* __restrict first = J[slots.vignetting];
  float* __restrict second = J[slots.vignetting + 1];
  for (int i = 0; i < kTile; ++i) {
    const float s = in.vignetting_s[i], j = -in.light[i] * s / in.falloff[i];
    first[i] = j;
    second[i] = j * s;
  }
}

NODAL_INLINE void ray_gradient(const HeadSight& head, TileHead& __restrict out) {
  const float r0 = head.R[0], r1 = head.R[1], r2 = head.R[2], r3 = head.R[3], r4 = head.R[4], r5 = head.R[5],
              r6 = head.R[6], r7 = head.R[7], r8 = head.R[8];
  for (int i = 0; i < kTile; ++i) {
    const float gu = out.gu[i], gv = out.gv[i], a = gu * out.q[i], b = gv * out.q[i];
    const float c = out.dq_dz[i] * (gu * out.x[i] + gv * out.y[i]);
    out.gradient[0][i] = r0 * a + r3 * b + r6 * c;
    out.gradient[1][i] = r1 * a + r4 * b + r7 * c;
    out.gradient[2][i] = r2 * a + r5 * b + r8 * c;
  }
}

NODAL_INLINE void add_weighted(const TileHead& in, RowsOut all, float* __restrict weights) {
  float* __restrict ax = all[0];
  float* __restrict ay = all[1];
  float* __restrict az = all[2];
  for (int i = 0; i < kTile; ++i) {
    const float w = in.weight[i];
    ax[i] += w * in.gradient[0][i];
    ay[i] += w * in.gradient[1][i];
    az[i] += w * in.gradient[2][i];
    weights[i] += w;
  }
}

// The mean of the other heads' gradients in the ray's tangent plane, converted to this head's picture. Per radian, the
// picture moves by r'(a) along the radius and by q across it: r' = q cos a - sin^2 a dq/dz.
NODAL_INLINE void picture_gradient_of_others(const HeadSight& head, const TileHead& in, Rows all,
                                             const float* __restrict weights, float* __restrict gu,
                                             float* __restrict gv) {
  const float r0 = head.R[0], r1 = head.R[1], r2 = head.R[2], r3 = head.R[3], r4 = head.R[4], r5 = head.R[5],
              r6 = head.R[6], r7 = head.R[7], r8 = head.R[8];
  const float* __restrict ax = all[0];
  const float* __restrict ay = all[1];
  const float* __restrict az = all[2];
  for (int i = 0; i < kTile; ++i) {
    const float w = in.weight[i], others = weights[i] - w;
    const float per = others > 0 ? 1 / others : 0.0F;
    const float gx = (ax[i] - w * in.gradient[0][i]) * per, gy = (ay[i] - w * in.gradient[1][i]) * per,
                gz = (az[i] - w * in.gradient[2][i]) * per;
    const float tx = r0 * gx + r1 * gy + r2 * gz, ty = r3 * gx + r4 * gy + r5 * gz, tz = r6 * gx + r7 * gy + r8 * gz;
    const float x = in.x[i], y = in.y[i], z = in.z[i], q = in.q[i], s2 = std::max(x * x + y * y, 1e-9F);
    const float slope = q * z - s2 * in.dq_dz[i], along = tx * x + ty * y;
    const float extra = ((z * along - s2 * tz) / slope - along / q) / s2;
    gu[i] = tx / q + x * extra;
    gv[i] = ty / q + y * extra;
  }
}

}  // namespace

bool may_see(const HeadSight& head, const Tile& tile) {
  const float c = head.axis[0] * tile.axis[0] + head.axis[1] * tile.axis[1] + head.axis[2] * tile.axis[2];
  // angle(axes) <= reach + radius, without an arc cosine.
  const float limit = head.cos_reach * tile.cos_radius - head.sin_reach * tile.sin_radius;
  const bool wraps = head.sin_reach * tile.cos_radius + head.cos_reach * tile.sin_radius < 0;
  return wraps || c >= limit;
}

NODAL_WIDE
bool project(const HeadSight& head, const Tile& tile, TileHead& out) {
  alignas(64) float t[kTile];
  turn(head, tile, t, out);
  alignas(64) float q0[kTile], s0[kTile], q1[kTile], s1[kTile];
  const RadialTable::Node* const nodes = head.table->nodes();
  const float* const density = head.table->density();
  for (int i = 0; i < kTile; ++i) {
    const RadialTable::Node& a = nodes[out.cell[i]];
    const RadialTable::Node& b = nodes[out.cell[i] + 1];
    q0[i] = a.q;
    s0[i] = a.slope;
    q1[i] = b.q;
    s1[i] = b.slope;
    out.weight[i] = density[out.cell[i]];
  }
  bend(head, t, {q0, s0, q1, s1}, out);
  if (!clip(head, t, out)) return false;
  fall_off(head, out);
  find_taps(head, out);
  return true;
}

NODAL_WIDE
void sample(const HeadSight& head, int plane, TileHead& out) {
  const float* const values = head.planes[static_cast<std::size_t>(plane)].values;
  const int channel = head.channels[static_cast<std::size_t>(plane)];
  alignas(64) float l00[kTile], l10[kTile], l01[kTile], l11[kTile];
  for (int i = 0; i < kTile; ++i) {
    const float* const p = values + out.offset[i];
    l00[i] = p[0];
    l10[i] = p[1];
    l01[i] = p[head.width];
    l11[i] = p[head.width + 1];
  }
  interpolate({l00, l10, l01, l11}, 1 / head.gain[channel], 1 / head.level_scale, out);
}

NODAL_WIDE
bool compare(TileHead* const* heads, int count, const Tile& tile, float huber, bool max_norm, TileRays& rays) {
  alignas(64) float seers[kTile], spread[kTile];
  for (int i = 0; i < kTile; ++i) rays.total[i] = rays.mean[i] = seers[i] = spread[i] = 0;
  for (int h = 0; h < count; ++h) {
    const TileHead& head = *heads[h];
    for (int i = 0; i < kTile; ++i) {
      rays.total[i] += head.weight[i];
      rays.mean[i] += head.weight[i] * head.light[i];
      seers[i] += head.weight[i] > 0 ? 1.0F : 0.0F;
    }
  }
  for (int i = 0; i < kTile; ++i) {
    const bool two = seers[i] > 1.5F;
    rays.measure[i] = two ? tile.omega[i] : 0.0F;
    rays.total[i] = two ? rays.total[i] : 1.0F;
    rays.mean[i] /= rays.total[i];
  }
  if (!any(rays.measure)) return false;
  for (int h = 0; h < count; ++h) {
    TileHead& head = *heads[h];
    for (int i = 0; i < kTile; ++i) {
      head.error[i] = head.light[i] - rays.mean[i];
      head.share[i] = head.weight[i] / rays.total[i];
      const float s = head.weight[i] * head.error[i] * head.error[i];
      spread[i] = max_norm ? (s > spread[i] ? s : spread[i]) : spread[i] + s;
    }
  }
  for (int i = 0; i < kTile; ++i) rays.active_total[i] = rays.active_error[i] = 0;
  for (int h = 0; h < count; ++h) {
    TileHead& head = *heads[h];
    for (int i = 0; i < kTile; ++i) {
      const float s = head.weight[i] * head.error[i] * head.error[i];
      head.active[i] = !max_norm || s >= spread[i] ? head.weight[i] : 0.0F;
      rays.active_total[i] += head.active[i];
      rays.active_error[i] += head.active[i] * head.error[i];
    }
  }
  const float per_huber = huber > 0 ? 1 / huber : 0.0F;
  for (int i = 0; i < kTile; ++i) {
    const float over = std::sqrt(spread[i] / rays.total[i]) * per_huber;
    const float factor = over > 1 ? 1 / over : 1.0F;
    rays.robust[i] = factor;
    rays.cost[i] = spread[i] * factor * (2 - factor);
  }
  return true;
}

NODAL_WIDE
void differentiate(const HeadSight& head, const Slots& slots, int channel, TileHead& out) {
  full_gradient(head, out);
  by_geometry(head, slots, out, out.gu, out.gv, out.J);
  by_radiometry(slots, channel, out, out.J);
}

NODAL_WIDE
void differentiate_by_others(const std::vector<HeadSight>& sights, const std::vector<Slots>& slots,
                             TileHead* const* heads, int count) {
  alignas(64) float all[3][kTile] = {}, weights[kTile] = {}, gu[kTile], gv[kTile];
  for (int h = 0; h < count; ++h) {
    ray_gradient(sights[static_cast<std::size_t>(heads[h]->head)], *heads[h]);
    add_weighted(*heads[h], all, weights);
  }
  for (int h = 0; h < count; ++h) {
    const auto i = static_cast<std::size_t>(heads[h]->head);
    picture_gradient_of_others(sights[i], *heads[h], all, weights, gu, gv);
    by_geometry(sights[i], slots[i], *heads[h], gu, gv, heads[h]->J_others);
    const int radiometry = slots[i].gain >= 0 ? slots[i].gain : slots[i].vignetting;
    for (int k = radiometry; k >= 0 && k < slots[i].count; ++k)
      std::ranges::copy(heads[h]->J[k], heads[h]->J_others[k]);
  }
}

}  // namespace nodal::registration
