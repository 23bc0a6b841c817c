#include "stitch/geometry/raymap/equirectangular.h"

#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

double theta_at(double x, int width) { return 2 * kPi * (x / width - 0.5); }
double phi_at(double y, int height) { return kPi * (y / height - 0.5); }

/// The angle of a coordinate: from the table if it is a multiple of half a pixel, computed otherwise.
template <class Angle>
SinCos look_up(const std::vector<SinCos>& halves, double at, const Angle& angle) {
  const auto half = static_cast<std::size_t>(2 * at);
  return static_cast<double>(half) == 2 * at ? halves[half] : SinCos::of(angle());
}

}  // namespace

// sin b - sin a = 2 cos((a + b) / 2) sin((b - a) / 2), without the cancellation.
Equirectangular::Equirectangular(int width, int height)
    : RaymapLayout(width, height), at_horizon_(4 * kPi / width * std::sin(0.5 * kPi / height)) {
  for (int k = 0; k <= 2 * width; ++k) theta_.push_back(SinCos::of(theta_at(k / 2.0, width)));
  for (int k = 0; k <= 2 * height; ++k) phi_.push_back(SinCos::of(phi_at(k / 2.0, height)));
}

Result<std::unique_ptr<RaymapLayout>> Equirectangular::make(RaymapSize size, std::int64_t) {
  return std::unique_ptr<RaymapLayout>(new Equirectangular(size.width, size.height));
}

std::optional<Ray> Equirectangular::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  return Ray::at(look_up(theta_, x, [&] { return theta_at(x, width()); }),
                 look_up(phi_, y, [&] { return phi_at(y, height()); }));
}

double Equirectangular::solid_angle(int, int j) const {
  return at_horizon_ * phi_[static_cast<std::size_t>(2 * j + 1)].cos;
}

std::optional<Pixel> Equirectangular::pixel(const Ray& ray) const {
  const Angles angles = ray.angles();
  return Pixel{(angles.theta / (2 * kPi) + 0.5) * width(), (angles.phi / kPi + 0.5) * height()};
}

std::vector<LayoutPatch> Equirectangular::patches() const {
  return {{.across = 4, .down = 2, .point = [this](double u, double v) {
             const Pixel at{u * width(), v * height()};
             return PatchPoint{at, *ray(at.x, at.y)};
           }}};
}

}  // namespace nodal::geometry
