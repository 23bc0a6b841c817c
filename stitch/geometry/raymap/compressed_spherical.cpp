#include "stitch/geometry/raymap/compressed_spherical.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {}  // namespace

CompressedSpherical::CompressedSpherical(RaymapSize size) : RaymapLayout(size.width, size.height) {
  for (int j = 0; j < size.height; ++j) {
    const double needed = size.width * std::cos(kPi * ((j + 0.5) / size.height - 0.5));
    // Less a little, so that the last bit of the cosine decides no row's width.
    used_.push_back(std::min(size.width, 2 * static_cast<int>(std::ceil(needed / 2 - 1e-9))));
  }
}

Result<std::unique_ptr<RaymapLayout>> CompressedSpherical::make(RaymapSize size, std::int64_t) {
  if (size.width % 2 != 0) {
    return fail(Errc::kBadValue, fmt::format("a compressed_spherical raymap has an even width, not {}; {} would be",
                                             size.width, size.width + 1));
  }
  return std::unique_ptr<RaymapLayout>(new CompressedSpherical(size));
}

int CompressedSpherical::row_of(double y) const { return std::clamp(static_cast<int>(y), 0, height() - 1); }

std::optional<Ray> CompressedSpherical::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  const int row = row_of(y);
  const int used = used_[static_cast<std::size_t>(row)];
  const double at = (x - first(row)) / used;
  if (at < 0 || at > 1) return std::nullopt;
  return Ray::at(Angles{2 * kPi * (at - 0.5), kPi * (y / height() - 0.5)});
}

double CompressedSpherical::solid_angle(int i, int j) const {
  const int used = used_[static_cast<std::size_t>(j)];
  if (i < first(j) || i >= first(j) + used) return 0;
  // sin b - sin a = 2 cos((a + b) / 2) sin((b - a) / 2), without the cancellation.
  return 4 * kPi / used * std::sin(0.5 * kPi / height()) * std::cos(kPi * ((j + 0.5) / height() - 0.5));
}

std::optional<Pixel> CompressedSpherical::pixel(const Ray& ray) const {
  const Angles angles = ray.angles();
  const double y = (angles.phi / kPi + 0.5) * height();
  const int row = row_of(y);
  return Pixel{first(row) + (angles.theta / (2 * kPi) + 0.5) * used_[static_cast<std::size_t>(row)], y};
}

std::vector<LayoutPatch> CompressedSpherical::patches() const {
  std::vector<LayoutPatch> rows;
  for (int j = 0; j < height(); ++j) {
    rows.push_back({.across = 4, .down = 0, .point = [this, j](double u, double v) {
                      const Angles angles{2 * kPi * (u - 0.5), kPi * ((j + v) / height() - 0.5)};
                      return PatchPoint{{first(j) + u * used_[static_cast<std::size_t>(j)], j + v}, Ray::at(angles)};
                    }});
  }
  return rows;
}

}  // namespace nodal::geometry
