// The cube raymap: six square faces in one picture.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Three by two faces of n x n pixels, in the order that players of `cbmp` boxes expect:
///   right left up
///   down front back
/// Each face is the upright picture of a 90-degree pinhole that looks that way; `up` has its front edge at the bottom
/// and `down` at the top. On the face z = 1 a pixel [x0,x1] x [y0,y1] spans
/// A(x1,y1) - A(x0,y1) - A(x1,y0) + A(x0,y0), A(x,y) = atan(x y / sqrt(1 + x^2 + y^2)).
class Cube final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(int width, int height);
  std::string_view name() const override { return "cube"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;

  int face_side() const { return width() / 3; }

 private:
  using RaymapLayout::RaymapLayout;
};

}  // namespace nodal::geometry
