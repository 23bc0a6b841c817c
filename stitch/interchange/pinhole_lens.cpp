#include "stitch/interchange/pinhole_lens.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/tsai_fit.h"

namespace nodal::interchange {
namespace {

constexpr double kMaxTangent = 60;  // beyond 89 degrees a pinhole has no picture

Status check_pinhole(const PinholeNumbers& p, const std::string& name) {
  if (p.fx >= 1 && p.fx <= 1e6 && p.fy >= 1 && p.fy <= 1e6 && std::abs(p.cx) <= 1e6 && std::abs(p.cy) <= 1e6) return {};
  return fail(Errc::kBadValue, "head '" + name +
                                   "': its focal lengths must be 1 to 1000000 px, and its principal "
                                   "point near the picture");
}

void set_pinhole(const PinholeNumbers& p, HeadCalibration& head) {
  head.center_x = p.cx + 0.5;
  head.center_y = p.cy + 0.5;
  head.aspect = p.fy / p.fx;
}

/// The tangent up to which the radial part rises.
double turning_tangent(const PlumbBob& bob) {
  double last = 0;
  for (double t = 0.002; t < kMaxTangent; t *= 1.002) {
    const double r = bob.bend({t, 0}).x();
    if (!(r > last)) return t / 1.002;
    last = r;
  }
  return kMaxTangent;
}

/// Ideal points whose images cover the picture evenly: one per cell, and the outermost ones, to include the corners.
std::vector<geometry::RayPixel> samples_of(const PinholeNumbers& p, const PlumbBob& bob, const HeadCalibration& head) {
  constexpr int kCells = 36;  // many more than a fit has unknowns
  constexpr int kRings = 300, kSpokes = 180;
  constexpr std::size_t kNone = SIZE_MAX;
  std::vector<std::size_t> taken(kCells * kCells, kNone);
  const double end = std::atan(0.995 * turning_tangent(bob));
  std::vector<geometry::RayPixel> samples;
  std::vector<Eigen::Vector2d> directions(kSpokes);
  for (int spoke = 0; spoke < kSpokes; ++spoke) {
    const double turn = 2 * kPi * spoke / kSpokes;
    directions[static_cast<std::size_t>(spoke)] = {std::cos(turn), std::sin(turn)};
  }
  for (int ring = 1; ring <= kRings; ++ring) {
    const double t = std::tan(end * ring / kRings);
    for (const Eigen::Vector2d& direction : directions) {
      const Eigen::Vector2d ideal = t * direction;
      const Eigen::Vector2d bent = bob.bend(ideal);
      const geometry::Pixel pixel{p.fx * bent.x() + p.cx + 0.5, p.fy * bent.y() + p.cy + 0.5};
      if (!(pixel.x >= 0 && pixel.y >= 0 && pixel.x < head.width && pixel.y < head.height)) continue;
      const auto cell = static_cast<std::size_t>(static_cast<int>(pixel.y * kCells / head.height) * kCells +
                                                 static_cast<int>(pixel.x * kCells / head.width));
      const geometry::RayPixel sample{{ideal.x(), ideal.y(), 1}, pixel};
      if (taken[cell] == kNone) {
        taken[cell] = samples.size();
        samples.push_back(sample);
      } else {
        samples[taken[cell]] = sample;
      }
    }
  }
  return samples;
}

bool any(const std::vector<double>& k, std::size_t first, std::size_t last) {
  for (std::size_t i = first; i < std::min(last, k.size()); ++i) {
    if (k[i] != 0) return true;
  }
  return false;
}

}  // namespace

Eigen::Vector2d PlumbBob::bend(const Eigen::Vector2d& ideal) const {
  const auto at = [this](std::size_t i) { return i < k.size() ? k[i] : 0.0; };
  const double x = ideal.x(), y = ideal.y();
  const double s = ideal.squaredNorm();
  const double over = 1 + s * (at(5) + s * (at(6) + s * at(7)));
  const double radial = (1 + s * (at(0) + s * (at(1) + s * at(4)))) / over;
  return {x * radial + 2 * at(2) * x * y + at(3) * (s + 2 * x * x) + s * (at(8) + s * at(9)),
          y * radial + at(2) * (s + 2 * y * y) + 2 * at(3) * x * y + s * (at(10) + s * at(11))};
}

Status set_plumb_bob(const PinholeNumbers& pinhole, const PlumbBob& bob, HeadCalibration& head,
                     std::vector<std::string>& notes) {
  const std::vector<double>& k = bob.k;
  if (k.size() > 5 && k.size() != 8 && k.size() != 12 && !(k.size() == 14 && !any(k, 12, 14))) {
    return fail(Errc::kUnsupported, fmt::format("head '{}': {} distortion coefficients; there are models of 4, 5, 8 "
                                                "and 12 (tilted sensors are not supported)",
                                                head.name, k.size()));
  }
  NODAL_TRY(check_pinhole(pinhole, head.name));
  set_pinhole(pinhole, head);
  if (!any(k, 2, 4) && !any(k, 5, 12)) {
    const auto at = [&](std::size_t i) { return i < k.size() ? k[i] : 0.0; };
    head.lens = RectilinearLens{{pinhole.fx, 0, pinhole.fx * at(0), 0, pinhole.fx * at(1), 0, pinhole.fx * at(4)}};
    auto& c = std::get<RectilinearLens>(head.lens).coefficients;
    while (c.size() > 1 && c.back() == 0) c.pop_back();
    return {};
  }
  PolynomialHead start;
  start.cx = head.center_x;
  start.cy = head.center_y;
  start.aspect = head.aspect;
  start.exponents = {1, 3, 5, 7, 9};
  const std::vector<geometry::RayPixel> samples = samples_of(pinhole, bob, head);
  // Tangential terms are mostly a shift of the centre and a rotation of the head.
  const FitFreedom freedom{any(k, 2, 4) || any(k, 8, 12), any(k, 8, 12), any(k, 2, 4) || any(k, 8, 12)};
  Result<PolynomialHead> best = fit_polynomial_head(samples, start, freedom);
  const auto try_other = [&] {
    Result<PolynomialHead> other = fit_polynomial_head(samples, start, freedom);
    if (other && (!best || other->rms_px < best->rms_px)) best = std::move(other);
  };
  start.basis = RadialBasis::kTangent;
  try_other();
  start.basis = RadialBasis::kAngle;
  start.exponents = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  try_other();
  if (!best) return fail(best.error().in("head '" + head.name + "'"));
  const std::optional<TsaiFit> tsai =
      freedom.turn ? std::nullopt : fit_tsai(samples, head.center_x, head.center_y, head.aspect);
  if (tsai && tsai->max_px < best->max_px) {
    head.lens = tsai->lens;
    tell_lens_fit(tsai->rms_px, tsai->max_px, "its rational distortion has no exact counterpart here", head, notes);
    return {};
  }
  take_fit(*best,
           any(k, 2, 4) || any(k, 8, 12) ? "its tangential distortion has no counterpart here"
                                         : "its rational distortion has no exact counterpart here",
           head, notes);
  return {};
}

Status set_kannala_brandt(const PinholeNumbers& pinhole, const std::vector<double>& k, HeadCalibration& head) {
  if (k.size() > 4) {
    return fail(Errc::kUnsupported,
                fmt::format("head '{}': a fisheye has 4 distortion coefficients, not {}", head.name, k.size()));
  }
  NODAL_TRY(check_pinhole(pinhole, head.name));
  set_pinhole(pinhole, head);
  KannalaBrandtLens lens{pinhole.fx, {}};
  std::ranges::copy(k, lens.k.begin());
  head.lens = lens;
  return {};
}

Status set_radial(const PinholeNumbers& pinhole, const std::function<double(double)>& radius, double end,
                  const std::string& what, HeadCalibration& head, std::vector<std::string>& notes) {
  NODAL_TRY(check_pinhole(pinhole, head.name));
  set_pinhole(pinhole, head);
  const double farthest = std::hypot(head.width, head.height);
  std::vector<geometry::RayPixel> samples;
  double last = 0;
  for (int i = 1; i <= 600; ++i) {
    const double a = end * i / 600;
    const double r = pinhole.fx * radius(a);
    if (!(r > last) || r > farthest) break;
    samples.push_back({{std::sin(a), 0, std::cos(a)}, {head.center_x + r, head.center_y}});
    last = r;
  }
  PolynomialHead start;
  start.cx = head.center_x;
  start.cy = head.center_y;
  start.aspect = head.aspect;
  start.exponents = {1, 3, 5, 7, 9};
  const Result<PolynomialHead> fit = fit_polynomial_head(samples, start, {false, false, false});
  if (!fit) return fail(fit.error().in("head '" + head.name + "'"));
  take_fit(*fit, what + " has no exact counterpart here", head, notes);
  return {};
}

}  // namespace nodal::interchange
