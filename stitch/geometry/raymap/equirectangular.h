// The equirectangular (latitude-longitude) raymap.
#pragma once

#include <vector>
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// theta = 2 pi (x / W - 1/2), phi = pi (y / H - 1/2): forward is in the middle, behind is at the left and right edges,
/// the zenith is the top edge. A pixel of row j spans (2 pi / W) (sin phi_bottom - sin phi_top).
class Equirectangular final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t);
  std::string_view name() const override { return "equirectangular"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  Equirectangular(int width, int height);

  /// Sine and cosine at every half pixel: nearly all queries are for pixel centres or the middle of two pixels.
  std::vector<SinCos> theta_;
  std::vector<SinCos> phi_;
  double at_horizon_;  ///< solid angle of a pixel if its centre were on the horizon, sr
};

}  // namespace nodal::geometry
