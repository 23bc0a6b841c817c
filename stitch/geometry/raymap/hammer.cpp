#include "stitch/geometry/raymap/hammer.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

/// The area of the unit disc between the axes and (u, v); negative where one of them is.
double disc_area(const Pixel& to) {
  const double u = std::min(1.0, std::abs(to.x)), v = std::min(1.0, std::abs(to.y));
  const double full = std::min(v, std::sqrt((1 - u) * (1 + u)));  // up to here the disc is wider than u
  const auto below = [](double y) { return 0.5 * (y * std::sqrt((1 - y) * (1 + y)) + std::asin(y)); };
  return std::copysign(1.0, to.x) * std::copysign(1.0, to.y) * (u * full + below(v) - below(full));
}

}  // namespace

Result<std::unique_ptr<RaymapLayout>> Hammer::make(RaymapSize size, std::int64_t) {
  return std::unique_ptr<RaymapLayout>(new Hammer(size.width, size.height));
}

/// Whether the pixel's nearest point to the middle is within the disc.
bool Hammer::touches(int i, int j) const {
  const Pixel low = on_disc(i, j), high = on_disc(i + 1, j + 1);
  return std::hypot(std::clamp(0.0, low.x, high.x), std::clamp(0.0, low.y, high.y)) < 1;
}

std::optional<Ray> Hammer::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  if (!touches(std::min(static_cast<int>(x), width() - 1), std::min(static_cast<int>(y), height() - 1)))
    return std::nullopt;
  const auto [u, v] = on_disc(x, y);
  const double square = u * u + v * v, s = std::sqrt(std::max(0.0, 2 - square));
  const double side = u * s, front = 1 - square;
  const double across2 = side * side + front * front;  // cos^2 phi
  const SinCos theta =
      across2 > 0 ? SinCos{2 * side * front / across2, (front - side) * (front + side) / across2} : SinCos{0, 1};
  return Ray::at(theta, {v * s, std::sqrt(across2)});
}

double Hammer::solid_angle(int i, int j) const {
  if (!touches(i, j)) return 0;
  // The disc's area of pi stands for 4 pi.
  const Pixel low = on_disc(i, j), high = on_disc(i + 1, j + 1);
  const double farthest =
      std::hypot(std::max(std::abs(low.x), std::abs(high.x)), std::max(std::abs(low.y), std::abs(high.y)));
  if (farthest <= 1) return 16.0 / (static_cast<double>(width()) * height());
  return std::max(0.0,
                  4 * (disc_area(high) - disc_area({low.x, high.y}) - disc_area({high.x, low.y}) + disc_area(low)));
}

Pixel Hammer::place(const Angles& angles) const {
  const double across = std::cos(angles.phi);
  const double s = std::sqrt(1 + across * std::cos(angles.theta / 2));
  const double u = across * std::sin(angles.theta / 2) / s, v = std::sin(angles.phi) / s;
  return {0.5 * (1 + u) * width(), 0.5 * (1 + v) * height()};
}

std::optional<Pixel> Hammer::pixel(const Ray& ray) const { return place(ray.angles()); }

std::vector<LayoutPatch> Hammer::patches() const {
  return {{.across = 4, .down = 2, .point = [this](double u, double v) {
             const Angles angles{(2 * u - 1) * kPi, (v - 0.5) * kPi};
             return PatchPoint{place(angles), Ray::at(angles)};
           }}};
}

}  // namespace nodal::geometry
