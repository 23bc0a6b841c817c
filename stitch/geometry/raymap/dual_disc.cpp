#include "stitch/geometry/raymap/dual_disc.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

struct Fisheye {
  static constexpr std::string_view kName = "dual_fisheye";
  static SinCos angle(double r) { return SinCos::of(r * kPi / 2); }
  static double radius(double alpha) { return alpha * 2 / kPi; }
  /// (1 - cos alpha) / r^2.
  static double cap(double r2) {
    if (r2 < 1e-12) return kPi * kPi / 8;
    const double sine = std::sin(std::sqrt(r2) * kPi / 4);
    return 2 * sine * sine / r2;
  }
};

struct Paraboloid {
  static constexpr std::string_view kName = "dual_paraboloid";
  static SinCos angle(double r) { return {2 * r / (1 + r * r), (1 - r * r) / (1 + r * r)}; }
  static double radius(double alpha) { return std::tan(alpha / 2); }
  static double cap(double r2) { return 2 / (1 + r2); }
};

/// The part of the segment a-b that is within the unit disc, as parameters 0..1; empty if from >= to.
struct Within {
  double from, to;
};

Within within_disc(const Pixel& a, const Pixel& b) {
  // |a + t (b - a)|^2 = 1.
  const double dx = b.x - a.x, dy = b.y - a.y;
  const double A = dx * dx + dy * dy, B = a.x * dx + a.y * dy, C = a.x * a.x + a.y * a.y - 1;
  const double D = B * B - A * C;
  if (D <= 0) return {1, 0};
  const double root = std::sqrt(D);
  return {std::max(0.0, (-B - root) / A), std::min(1.0, (-B + root) / A)};
}

template <class Lens>
class DualDisc final : public RaymapLayout {
 public:
  explicit DualDisc(RaymapSize size) : RaymapLayout(size.width, size.height) {}
  std::string_view name() const override { return Lens::kName; }
  bool scattered() const override { return false; }

  std::optional<Ray> ray(double x, double y) const override {
    if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
    const bool back = x >= height();
    const Pixel at = on_disc({x, y}, back);
    const int i = std::min(static_cast<int>(x), width() - 1), j = std::min(static_cast<int>(y), height() - 1);
    if (!touches(i, j)) return std::nullopt;
    return ray_in(at, back);
  }

  /// Green's theorem about the axis: a region spans the integral of (1 - cos alpha) d psi over its boundary, psi being
  /// the direction about the axis. An edge that two pixels share counts once with each sign, so all sum to 4 pi.
  double solid_angle(int i, int j) const override {
    if (!touches(i, j)) return 0;
    const bool back = i >= height();
    const std::array<Pixel, 4> corners{on_disc({i + 0.0, j + 0.0}, back), on_disc({i + 1.0, j + 0.0}, back),
                                       on_disc({i + 1.0, j + 1.0}, back), on_disc({i + 0.0, j + 1.0}, back)};
    struct Piece {
      Pixel in, out;
    };
    std::array<Piece, 4> pieces;  // parts of the pixel's edges that are within the disc
    std::size_t count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const Pixel &a = corners[k], &b = corners[(k + 1) % 4];
      const Within part = within_disc(a, b);
      if (part.from >= part.to) continue;
      const auto at = [&](double t) { return Pixel{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)}; };
      pieces[count++] = {part.from > 0 ? at(part.from) : a, part.to < 1 ? at(part.to) : b};
    }
    // From one piece to the next: along the rim, or nowhere if they meet in a corner.
    double sum = 0;
    for (std::size_t k = 0; k < count; ++k) {
      sum += along(pieces[k].in, pieces[k].out) + turn(pieces[k].out, pieces[(k + 1) % count].in);
    }
    return sum;
  }

  std::optional<Pixel> pixel(const Ray& ray) const override {
    const bool back = ray.z() < 0;
    const double side = std::hypot(ray.x(), ray.y());
    const double r = Lens::radius(std::atan2(side, std::abs(ray.z())));
    const double scale = side > 0 ? r / side : 0;
    const double half = 0.5 * height();
    return Pixel{(back ? 3 : 1) * half + (back ? -1 : 1) * ray.x() * scale * half, half + ray.y() * scale * half};
  }

  std::vector<LayoutPatch> patches() const override {
    std::vector<LayoutPatch> patches;
    for (const bool back : {false, true}) {
      patches.push_back(
          {.across = 4, .point = [this, back](double u, double v) {
             // Around the disc, the last direction is the first; on the back one rows run the other way.
             const SinCos turned = u < 1 ? SinCos::of(2 * kPi * u) : SinCos{0, 1};
             const Pixel on{(back ? -v : v) * turned.cos, v * turned.sin};
             const double half = 0.5 * height();
             return PatchPoint{{(back ? 3 + on.x : 1 + on.x) * half, (1 + on.y) * half}, ray_in(on, back)};
           }});
    }
    return patches;
  }

 private:
  static Ray ray_in(const Pixel& at, bool back) {
    const double r = std::hypot(at.x, at.y);
    const SinCos alpha = Lens::angle(r);
    const double across = r > 0 ? alpha.sin / r : 0;
    return back ? Ray::towards(-at.x * across, at.y * across, -alpha.cos)
                : Ray::towards(at.x * across, at.y * across, alpha.cos);
  }
  Pixel on_disc(Pixel at, bool back) const {
    return {2 * (at.x - (back ? height() : 0)) / height() - 1, 2 * at.y / height() - 1};
  }
  /// Whether the pixel's nearest point to the disc's centre is within the disc.
  bool touches(int i, int j) const {
    const bool back = i >= height();
    const Pixel low = on_disc({i + 0.0, j + 0.0}, back), high = on_disc({i + 1.0, j + 1.0}, back);
    return std::hypot(std::clamp(0.0, low.x, high.x), std::clamp(0.0, low.y, high.y)) < 1;
  }
  /// The integral along a straight piece within the disc, by Gauss's rule with three points: of a smooth function, over
  /// a pixel at most.
  static double along(const Pixel& a, const Pixel& b) {
    constexpr std::array kAt{-0.7745966692414834, 0.0, 0.7745966692414834};
    constexpr std::array kWeight{5.0 / 18, 8.0 / 18, 5.0 / 18};
    const double dx = b.x - a.x, dy = b.y - a.y;
    double sum = 0;
    for (std::size_t k = 0; k < kAt.size(); ++k) {
      const double t = 0.5 + 0.5 * kAt[k], x = a.x + t * dx, y = a.y + t * dy;
      sum += kWeight[k] * Lens::cap(x * x + y * y);
    }
    return sum * (a.x * dy - a.y * dx);
  }
  /// Along the rim, where 1 - cos alpha = 1.
  static double turn(const Pixel& a, const Pixel& b) {
    return std::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y);
  }
};

template <class Lens>
Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size) {
  if (size.width != 2 * size.height) {
    return fail(Errc::kBadValue, fmt::format("a {} raymap is twice as wide as high, and {}x{} is not; {}x{} would be",
                                             Lens::kName, size.width, size.height, 2 * size.height, size.height));
  }
  return std::make_unique<DualDisc<Lens>>(size);
}

}  // namespace

Result<std::unique_ptr<RaymapLayout>> make_dual_fisheye(RaymapSize size, std::int64_t) { return make<Fisheye>(size); }
Result<std::unique_ptr<RaymapLayout>> make_dual_paraboloid(RaymapSize size, std::int64_t) {
  return make<Paraboloid>(size);
}

}  // namespace nodal::geometry
