// The sinusoidal raymap (§5; Sanson, Flamsteed).
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// phi = pi (y / H - 1/2), theta = 2 pi (x - W / 2) / (W cos phi): equal area, 2 pi^2 / (W H) sr per pixel. Every pixel
/// that the map touches holds a ray; those on its edge continue the formula beyond |theta| = pi and represent the part
/// of them that is on the map.
class Sinusoidal final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t);
  std::string_view name() const override { return "sinusoidal"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  using RaymapLayout::RaymapLayout;
  double half_width(double y) const;
};

}  // namespace nodal::geometry
