// The layout of a list of rays from a file (§5: any set of rays).
#pragma once

#include "stitch/geometry/raymap/ray_list.h"
#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::geometry {

/// Pixels hold the rays in the order of the file. The list says nothing about solid angles: every pixel counts as an
/// equal part of the sphere.
class ListedRays final : public ScatteredRays {
 public:
  /// `digits`: of a list that is known. Errors: kNotFound; kBadValue for another size than the list's.
  static Result<std::unique_ptr<RaymapLayout>> make(RaymapSize size, std::int64_t digits);
  std::string_view name() const override { return "rays"; }
  double solid_angle(int, int) const override;

 protected:
  Ray ray_of(int i, int j) const override;

 private:
  explicit ListedRays(const RayList& list) : ScatteredRays(list.size.width, list.size.height), list_(list) {}

  const RayList& list_;  ///< stays
};

}  // namespace nodal::geometry
