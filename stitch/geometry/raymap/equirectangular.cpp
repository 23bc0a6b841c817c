#include "stitch/geometry/raymap/equirectangular.h"

#include <cmath>
#include <numbers>

namespace nodal::geometry {
namespace {

constexpr double kPi = std::numbers::pi;

}  // namespace

Result<std::unique_ptr<RaymapLayout>> Equirectangular::make(int width, int height) {
  return std::unique_ptr<RaymapLayout>(new Equirectangular(width, height));
}

std::optional<Ray> Equirectangular::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  return Ray::at({2 * kPi * (x / width() - 0.5), kPi * (y / height() - 0.5)});
}

double Equirectangular::solid_angle(int, int j) const {
  // sin b - sin a = 2 cos((a + b) / 2) sin((b - a) / 2), without the cancellation.
  const double middle = kPi * ((j + 0.5) / height() - 0.5);
  return 4 * kPi / width() * std::cos(middle) * std::sin(0.5 * kPi / height());
}

std::optional<Pixel> Equirectangular::pixel(const Ray& ray) const {
  const Angles angles = ray.angles();
  return Pixel{(angles.theta / (2 * kPi) + 0.5) * width(), (angles.phi / kPi + 0.5) * height()};
}

}  // namespace nodal::geometry
