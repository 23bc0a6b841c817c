// The equirectangular (latitude-longitude) raymap.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// theta = 2 pi (x / W - 1/2), phi = pi (y / H - 1/2): forward in the middle, the left and right edges behind,
/// the zenith along the top. A pixel of row j spans (2 pi / W) (sin phi_bottom - sin phi_top).
class Equirectangular final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(int width, int height);
  std::string_view name() const override { return "equirectangular"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;

 private:
  Equirectangular(int width, int height);

  /// Every half pixel's angle: what is asked for are nearly always centres of pixels, or of pairs of them.
  std::vector<SinCos> theta_;
  std::vector<SinCos> phi_;
  double at_horizon_;  ///< a pixel's solid angle if its middle were there, sr
};

}  // namespace nodal::geometry
