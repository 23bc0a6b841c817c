// Samples a raymap along one ray, also where neighbouring pixels are not neighbours on the sphere.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>

#include "protocol/base/image.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/raymap/scattered_rays.h"
#include "stitch/view/filter.h"
#include "stitch/view/pieces.h"
#include "stitch/view/sample.h"

namespace nodal::view {

/// Where a ray is in the raymap, px; NaN if it is not there.
struct Position {
  double x = std::numeric_limits<double>::quiet_NaN();
  double y = std::numeric_limits<double>::quiet_NaN();
};

/// Weighted sums of 8-bit samples are computed in single precision, those of 16-bit ones in double.
template <class Sample>
struct Sum {
  using Real = typename Samples<Sample>::Real;
  Real value[3] = {0, 0, 0};
};

/// Where the pixels around a position are not neighbours on the sphere (edges of faces, of discs, of rows), a sample is
/// the mean of the nearest pixels of nine rays about it, weighted by their distance; in scattered raymaps, that of its
/// natural neighbours.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the layout and its pieces by reference.
class PointSampler {
 public:
  PointSampler(const geometry::RaymapLayout& layout, const Pieces& pieces, Filter filter);

  /// Adds the raymap at a position; `ray` is called only where the position is not sufficient.
  template <class Sample>
  void add(const PlaneView& plane, int channels, const Position& at, const std::function<geometry::Ray()>& ray,
           Sum<Sample>& sum) const;
  /// Distance of neighbouring rays, rad; at least the mean over the raymap.
  double pitch_at(const Position& at) const;

 private:
  template <class Sample>
  void add_across_edge(const PlaneView& plane, int channels, const geometry::Ray& ray, Sum<Sample>& sum) const;
  template <class Sample>
  void add_natural(const PlaneView& plane, int channels, const geometry::Ray& ray, Sum<Sample>& sum) const;

  const geometry::RaymapLayout& layout_;
  const geometry::ScatteredRays* scattered_;  ///< the layout, or null
  const Pieces& pieces_;
  Filter filter_;
  double mean_sr_;
};

}  // namespace nodal::view
