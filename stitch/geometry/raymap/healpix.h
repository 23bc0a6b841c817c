// The HEALPix raymap (Górski et al. 2005, The Astrophysical Journal 622).
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Twelve base faces of n x n pixels, which all span exactly 4 pi / (12 n^2): in the first row of the picture the four
/// about the zenith, then the four about the horizon, then those about the nadir. North is the upper right corner of a
/// face, whose columns follow HEALPix's x and whose rows follow -y; longitude 0 is the middle of the picture, forward.
class Healpix final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t);
  std::string_view name() const override { return "healpix"; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  using RaymapLayout::RaymapLayout;
};

}  // namespace nodal::geometry
