#include "stitch/geometry/raymap/sinusoidal.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {}  // namespace

Result<std::unique_ptr<RaymapLayout>> Sinusoidal::make(RaymapSize size, std::int64_t) {
  return std::unique_ptr<RaymapLayout>(new Sinusoidal(size.width, size.height));
}

/// Half the length of the row at y, px.
double Sinusoidal::half_width(double y) const { return 0.5 * width() * std::cos(kPi * (y / height() - 0.5)); }

std::optional<Ray> Sinusoidal::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  const double off = x - 0.5 * width();
  // The pixel that contains x touches the map if the row is long enough at the pixel's nearest edges.
  const double row = std::min(std::floor(y), height() - 1.0);
  const double column = std::min(std::floor(x), width() - 1.0) - 0.5 * width();
  const double nearest = column < 0 ? std::max(0.0, -column - 1) : column;
  const double longest = half_width(std::clamp(0.5 * height(), row, row + 1));
  if (nearest >= longest) return std::nullopt;
  const double half = half_width(y);
  const double theta = half > 1e-9 ? kPi * off / half : 0;
  return Ray::at(Angles{theta, kPi * (y / height() - 0.5)});
}

double Sinusoidal::solid_angle(int i, int j) const {
  // Over the row, the length of the map within the pixel by Gauss's rule with four points. Whichever pixel an edge goes
  // through, the row's sum is the integral of the cosine.
  constexpr std::array kAt{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
  constexpr std::array kWeight{0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269};
  double area = 0;
  for (std::size_t k = 0; k < kAt.size(); ++k) {
    const double half = half_width(j + 0.5 + 0.5 * kAt[k]);
    const double from = std::max(i - 0.5 * width(), -half), to = std::min(i + 1 - 0.5 * width(), half);
    area += kWeight[k] * std::max(0.0, to - from);
  }
  return 2 * kPi * kPi / width() / height() * area;
}

std::optional<Pixel> Sinusoidal::pixel(const Ray& ray) const {
  const Angles angles = ray.angles();
  const double y = (angles.phi / kPi + 0.5) * height();
  return Pixel{0.5 * width() + angles.theta / kPi * half_width(y), y};
}

std::vector<LayoutPatch> Sinusoidal::patches() const {
  return {{.across = 4, .down = 2, .point = [this](double u, double v) {
             const Angles angles{(2 * u - 1) * kPi, (v - 0.5) * kPi};
             const double y = v * height();
             return PatchPoint{{0.5 * width() + (2 * u - 1) * half_width(y), y}, Ray::at(angles)};
           }}};
}

}  // namespace nodal::geometry
