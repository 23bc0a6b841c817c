// Hammer's raymap: equal area in an ellipse.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Hammer's projection (1892), FFmpeg's `hammer`. With u = 2 x / W - 1 and v = 2 y / H - 1, the map is the disc
/// u^2 + v^2 <= 1: Lambert's azimuthal equal-area map of a hemisphere, in which half the longitude stands for the
/// longitude,
///   (cos phi sin(theta / 2), sin phi, cos phi cos(theta / 2)) = (u s, v s, 1 - u^2 - v^2), s = sqrt(2 - u^2 - v^2).
/// A whole pixel spans 16 / (W H). Every pixel that the disc touches holds a ray; those on the rim continue the formula
/// and represent the part of them that is within the disc.
class Hammer final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t);
  std::string_view name() const override { return "hammer"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  using RaymapLayout::RaymapLayout;
  Pixel on_disc(double x, double y) const { return {2 * x / width() - 1, 2 * y / height() - 1}; }
  Pixel place(const Angles& angles) const;
  bool touches(int i, int j) const;
};

}  // namespace nodal::geometry
