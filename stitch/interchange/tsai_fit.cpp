#include "stitch/interchange/tsai_fit.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "stitch/solve/normal_equations.h"

namespace nodal::interchange {
namespace {

constexpr int kPasses = 4;

struct Radius {
  double r = 0;        // px, aspect taken out
  double tangent = 0;  // tangent of the ray's angle
};

double slope(const Eigen::Vector3d& x, double s) { return 1 + s * (3 * x[1] + s * 5 * x[2]); }

}  // namespace

std::optional<TsaiFit> fit_tsai(const std::vector<geometry::RayPixel>& samples, double cx, double cy, double aspect) {
  std::vector<Radius> radii;
  double unit = 1;
  for (const geometry::RayPixel& sample : samples) {
    if (!(sample.ray.z() > 0)) return std::nullopt;
    const double r = std::hypot(sample.pixel.x - cx, (sample.pixel.y - cy) / aspect);
    radii.push_back({r, std::hypot(sample.ray.x(), sample.ray.y()) / sample.ray.z()});
    unit = std::max(unit, r);
  }
  // f t - k1 r^3 - k2 r^5 = r is linear; dividing by the slope gives px in the picture. Radii in units of the largest.
  Eigen::Vector3d x(0, 0, 0);
  for (int pass = 0; pass < kPasses; ++pass) {
    solve::NormalEquations sum(3);
    for (const Radius& p : radii) {
      const double r = p.r / unit, s = r * r;
      const double under = std::max(slope(x, s), 0.1);
      const Eigen::Vector3d row = Eigen::Vector3d(p.tangent, -r * s, -r * s * s) / under;
      sum.add(row.data(), -r / under, 1);
    }
    x = sum.step(0, {});
    if (!x.allFinite() || !(x[0] > 0)) return std::nullopt;
  }
  TsaiFit fit{{x[0] * unit, x[1] / (unit * unit), x[2] / std::pow(unit, 4)}, 0, 0};
  for (const Radius& p : radii) {
    const double r = p.r / unit, s = r * r;
    if (!(slope(x, s) > 0.05)) return std::nullopt;
    const double off = unit * std::abs(r * (1 + s * (x[1] + s * x[2])) - x[0] * p.tangent) / slope(x, s);
    fit.rms_px += off * off / static_cast<double>(radii.size());
    fit.max_px = std::max(fit.max_px, off);
  }
  fit.rms_px = std::sqrt(fit.rms_px);
  return fit;
}

}  // namespace nodal::interchange
