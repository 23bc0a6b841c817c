#include "stitch/geometry/raymap/cylinder.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

/// A cylinder with `Rows`' relation between the height on it, -1..1, and the sine of the latitude.
template <class Rows>
class Cylinder final : public RaymapLayout {
 public:
  Cylinder(RaymapSize size, Rows rows) : RaymapLayout(size.width, size.height), rows_(rows) {}
  std::string_view name() const override { return Rows::kName; }
  bool scattered() const override { return false; }

  std::optional<Ray> ray(double x, double y) const override {
    if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
    const double sine = rows_.sine(2 * y / height() - 1);
    return Ray::at(SinCos::of(2 * kPi * (x / width() - 0.5)),
                   {sine, std::sqrt(std::max(0.0, (1 - sine) * (1 + sine)))});
  }
  double solid_angle(int, int j) const override {
    return 2 * kPi / width() * (rows_.sine(2.0 * (j + 1) / height() - 1) - rows_.sine(2.0 * j / height() - 1));
  }
  std::optional<Pixel> pixel(const Ray& ray) const override {
    const double at = rows_.height_at(ray);
    if (!(at >= -1 && at <= 1)) return std::nullopt;
    return Pixel{(ray.angles().theta / (2 * kPi) + 0.5) * width(), 0.5 * (at + 1) * height()};
  }
  std::vector<LayoutPatch> patches() const override {
    return {{.across = 4, .down = 2, .point = [this](double u, double v) {
               const Pixel at{u * width(), 0.5 * (1 + Rows::spread(2 * v - 1)) * height()};
               return PatchPoint{at, *ray(at.x, at.y)};
             }}};
  }

 private:
  Rows rows_;
};

struct EqualArea {
  static constexpr std::string_view kName = "cylinder_equal_area";
  static double sine(double at) { return at; }
  static double height_at(const Ray& ray) { return ray.y(); }
  /// The height is no smooth function of a mesh's rows at a pole, so that rows are the closer the nearer they are.
  static double spread(double v) {
    return std::sin(std::copysign(kPi / 2 * (1 - (1 - std::abs(v)) * (1 - std::abs(v))), v));
  }
};

/// Rays at the very edge of the picture count as inside, whatever rounding does.
double within(double at) { return std::abs(at) <= 1 + 1e-12 ? std::clamp(at, -1.0, 1.0) : at; }

struct Central {
  static constexpr std::string_view kName = "central_cylinder";
  double half;  ///< tan(fov / 2)
  static double spread(double v) { return v; }
  double sine(double at) const { return half * at / std::sqrt(1 + half * half * at * at); }
  double height_at(const Ray& ray) const { return within(ray.y() / std::hypot(ray.x(), ray.z()) / half); }
};

struct Mercator {
  static constexpr std::string_view kName = "mercator";
  static double spread(double v) { return v; }
  static double sine(double at) { return std::tanh(kPi * at); }
  static double height_at(const Ray& ray) { return within(std::asinh(ray.y() / std::hypot(ray.x(), ray.z())) / kPi); }
};

}  // namespace

Result<std::unique_ptr<RaymapLayout>> make_cylinder_equal_area(RaymapSize size, std::int64_t) {
  return std::make_unique<Cylinder<EqualArea>>(size, EqualArea{});
}

Result<std::unique_ptr<RaymapLayout>> make_central_cylinder(RaymapSize size, std::int64_t fov_deg) {
  return std::make_unique<Cylinder<Central>>(size, Central{std::tan(static_cast<double>(fov_deg) * kPi / 360)});
}

Result<std::unique_ptr<RaymapLayout>> make_mercator(RaymapSize size, std::int64_t) {
  return std::make_unique<Cylinder<Mercator>>(size, Mercator{});
}

}  // namespace nodal::geometry
