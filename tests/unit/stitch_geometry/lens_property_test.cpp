// Properties of every lens over its whole domain.
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <cmath>

#include "examples.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::geometry {
namespace {

/// Angles over the whole domain, denser at both ends: at the axis formulas divide by 0, and at the turning point
/// inverses are steep.
double angle_of(const Lens& lens) {
  const double part = between(0, 1);
  const double end = lens.max_angle();
  switch (*rc::gen::inRange(0, 4)) {
    case 0: return end * part;
    case 1: return end * part * 1e-7;
    case 2: return end * (1 - part * 1e-7);
    default: return *rc::gen::element(0.0, end, end / 2);
  }
}

RC_GTEST_PROP(EveryLens, AngleOfRadiusOfAngle_IsTheAngle, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Lens lens = *Lens::make(model);
    const double a = angle_of(lens);
    const std::optional<double> r = lens.radius(a);
    RC_ASSERT(r.has_value());
    const std::optional<double> back = lens.angle(*r);
    RC_ASSERT(back.has_value());
    // Rounding changes r by about 1e-16 of its value. The slope converts this to an angle; at a turning point, where
    // the slope is 0, the curvature does: the square root of it.
    const double noise = 4e-16 * (1 + *r);
    const double slope = lens.slope(a, *r);
    const double tolerance = 1e-14 + std::min(noise / std::max(slope, 1e-300), 4e-6);
    RC_ASSERT(std::abs(*back - a) <= tolerance * 4);
  }
}

RC_GTEST_PROP(EveryLens, RadiusOfAngleOfRadius_IsTheRadius, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Lens lens = *Lens::make(model);
    // Up to radii that occur in pictures; a Tsai lens's own limit is far beyond.
    const double r = std::min(lens.max_radius(), 3000.0) * between(0, 1);
    const std::optional<double> a = lens.angle(r);
    RC_ASSERT(a.has_value());
    const std::optional<double> back = lens.radius(*a);
    RC_ASSERT(back.has_value());
    RC_ASSERT(std::abs(*back - r) <= 1e-9);
  }
}

RC_GTEST_PROP(EveryLens, RadiusRisesWithTheAngle, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Lens lens = *Lens::make(model);
    const double a = between(0, 0.999) * lens.max_angle();
    const double b = a + (lens.max_angle() - a) * between(0.001, 1);
    RC_ASSERT(*lens.radius(a) < *lens.radius(b));
  }
}

RC_GTEST_PROP(EveryLens, Slope_IsTheRadiusesDifferenceQuotient, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Lens lens = *Lens::make(model);
    // Finite differences fail close to 89.99 degrees, where a pinhole's slope is unbounded, and close to a Tsai lens's
    // turning point, where its inverse's slope is.
    const double end = std::min(0.99 * lens.max_angle(), 1.35);
    const double h = 1e-5;
    const double a = h + (end - 2 * h) * between(0, 1);
    const double quotient = (*lens.radius(a + h) - *lens.radius(a - h)) / (2 * h);
    const double slope = lens.slope(a);
    RC_ASSERT(std::abs(slope - quotient) <= 1e-5 * (std::abs(slope) + 300));
  }
}

}  // namespace
}  // namespace nodal::geometry
