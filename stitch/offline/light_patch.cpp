#include "stitch/offline/light_patch.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace nodal::offline {
namespace {

using Eigen::Vector3d;

constexpr double kClipped = 254;  ///< levels

}  // namespace

LightPatch::LightPatch(int half, double pixel, const Vector3d& axis,
                       const std::function<float(const Vector3d&, double)>& light)
    : side_(2 * half + 1), light_(static_cast<std::size_t>(side_ * side_)) {
  const Vector3d right = (std::abs(axis.y()) > 0.9 ? Vector3d::UnitZ() : Vector3d::UnitY()).cross(axis).normalized();
  const Vector3d down = axis.cross(right);
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      const Vector3d ray = (axis + pixel * (i * right + j * down)).normalized();
      light_[static_cast<std::size_t>((j + half) * side_ + i + half)] = light(ray, pixel);
    }
  }
}

Likeness likeness(const LightPatch& a, const LightPatch& b, int half, int x, int y) {
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0, unclipped = 0, step = 0;
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      const double u = static_cast<double>(a.at(i, j)), v = static_cast<double>(b.at(i + x, j + y));
      if (u < 0 || v < 0) continue;
      ++n;
      sa += u, sb += v;
      saa += u * u, sbb += v * v, sab += u * v;
      if (u < kClipped && v < kClipped) step += v - u, ++unclipped;
    }
  }
  Likeness found;
  found.shared = n / ((2 * half + 1) * (2 * half + 1));
  if (n < 2) return found;
  const double va = std::max(0.0, saa / n - sa * sa / n / n), vb = std::max(0.0, sbb / n - sb * sb / n / n);
  found.detail = std::sqrt(std::max(va, vb));
  if (va * vb > 1e-6) found.correlation = (sab / n - sa * sb / n / n) / std::sqrt(va * vb);
  if (unclipped > 0) found.step = step / unclipped;
  return found;
}

double coherence(const LightPatch& patch) {
  double xx = 0, yy = 0, xy = 0;
  for (int j = 1 - patch.half(); j < patch.half(); ++j) {
    for (int i = 1 - patch.half(); i < patch.half(); ++i) {
      const std::array<float, 4> around{patch.at(i - 1, j), patch.at(i + 1, j), patch.at(i, j - 1), patch.at(i, j + 1)};
      if (std::ranges::min(around) < 0) continue;
      const double x = static_cast<double>(around[1] - around[0]), y = static_cast<double>(around[3] - around[2]);
      xx += x * x, yy += y * y, xy += x * y;
    }
  }
  return xx + yy > 0 ? std::hypot(xx - yy, 2 * xy) / (xx + yy) : 0;
}

}  // namespace nodal::offline
