#include "stitch/geometry/raymap/point_sequence.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::geometry {
namespace {

double radical_inverse(std::uint64_t base, std::uint64_t k) {
  std::uint64_t mirrored = 0, scale = 1;  // k is below 2^31, so both stay below 3^20 and 2^31
  for (; k > 0; k /= base, scale *= base) mirrored = mirrored * base + k % base;
  return static_cast<double>(mirrored) / static_cast<double>(scale);
}

template <class Sequence>
class PointSequence final : public ScatteredRays {
 public:
  explicit PointSequence(RaymapSize size) : ScatteredRays(size.width, size.height) {}
  std::string_view name() const override { return Sequence::kName; }
  double solid_angle(int, int) const override { return 4 * kPi / width() / height(); }
  Cells cells(std::int64_t rays, double side) const override {
    return Sequence::cells(std::int64_t{width()} * height(), rays, side);
  }

 protected:
  Ray ray_of(int i, int j) const override {
    const auto w = static_cast<std::uint64_t>(width());
    const auto k = static_cast<std::uint64_t>(j) * w + static_cast<std::uint64_t>(i);
    const auto [u, v] = Sequence::point(k, w * static_cast<std::uint64_t>(height()));
    return Ray::at(SinCos::of(2 * kPi * (v - 0.5)), {2 * u - 1, 2 * std::sqrt(u * (1 - u))});
  }
};

struct Point {
  double u, v;
};

struct Hammersley {
  static constexpr std::string_view kName = "hammersley";
  static Point point(std::uint64_t k, std::uint64_t count) {
    return {(static_cast<double>(k) + 0.5) / static_cast<double>(count), radical_inverse(2, k)};
  }
  /// Consecutive points are a band along a circle of latitude. `n` evenly spread rays are sqrt(4 pi / n) apart, and a
  /// band of that height at the equator has sqrt(pi n) of them; nearer to a pole it is higher.
  static RaymapLayout::Cells cells(std::int64_t n, std::int64_t rays, double side) {
    const auto band = static_cast<std::int64_t>(std::ceil(side * std::sqrt(kPi * static_cast<double>(n))));
    const std::int64_t run = std::max(rays, band);
    return {static_cast<std::uint64_t>((n + run - 1) / run), static_cast<std::uint64_t>(run)};
  }
};

struct Halton {
  static constexpr std::string_view kName = "halton";
  static Point point(std::uint64_t k, std::uint64_t) { return {radical_inverse(2, k + 1), radical_inverse(3, k + 1)}; }
  /// The points k, k + 2^a 3^b, .. share the first a digits of u and the first b digits of v. Cells are about square at
  /// the equator of the equal-area cylinder, which is pi times as wide as high.
  static RaymapLayout::Cells cells(std::int64_t n, std::int64_t rays, double) {
    const std::int64_t most = n / rays;
    std::int64_t halves = 1, thirds = 1;
    for (;;) {
      const bool wide = kPi / static_cast<double>(thirds) > 1 / static_cast<double>(halves);
      const std::int64_t next = halves * thirds * (wide ? 3 : 2);
      if (next > most) break;
      (wide ? thirds : halves) *= wide ? 3 : 2;
    }
    return {static_cast<std::uint64_t>(halves * thirds), 1};
  }
};

}  // namespace

Result<std::unique_ptr<RaymapLayout>> make_hammersley(RaymapSize size, std::int64_t) {
  return std::make_unique<PointSequence<Hammersley>>(size);
}

Result<std::unique_ptr<RaymapLayout>> make_halton(RaymapSize size, std::int64_t) {
  return std::make_unique<PointSequence<Halton>>(size);
}

}  // namespace nodal::geometry
