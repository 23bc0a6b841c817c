// The compressed spherical raymap (§5).
#pragma once

#include <vector>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Rows as in the equirectangular raymap, phi = pi (y / H - 1/2), but row j holds only w(j) rays,
/// theta = 2 pi ((x - (W - w) / 2) / w - 1/2). w(j) is W cos phi_j, at the row's centre, rounded up to an even number.
/// So neighbours are as far apart in every row, and 1 - 2 / pi of the pixels hold no ray. A pixel spans
/// (2 pi / w) (sin phi_bottom - sin phi_top).
class CompressedSpherical final : public RaymapLayout {
 public:
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t);
  std::string_view name() const override { return "compressed_spherical"; }
  bool scattered() const override { return false; }
  bool smooth() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  explicit CompressedSpherical(RaymapSize size);
  int row_of(double y) const;
  int first(int row) const { return (width() - used_[static_cast<std::size_t>(row)]) / 2; }

  std::vector<int> used_;  ///< w, by row
};

}  // namespace nodal::geometry
