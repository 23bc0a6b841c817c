// Voronoi cells of rays on the sphere.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::view {

/// The Voronoi cell of a ray, a convex polygon on the plane that touches the sphere there. A great circle is a line.
class VoronoiCell {
 public:
  static constexpr int kNobody = -1;
  struct Corner {
    Eigen::Vector2d at;
    int edge;  ///< the ray whose edge begins here, or kNobody
  };

  /// Begins with a square of this half side.
  explicit VoronoiCell(double half);
  /// Removes the part that is nearer to another ray: toward . t > offset.
  void cut(const Eigen::Vector2d& toward, double offset, int other);
  /// The distance of the farthest corner.
  double radius() const;
  /// Corners, sorted around the ray.
  const std::vector<Corner>& corners() const { return corners_; }

 private:
  std::vector<Corner> corners_;
};

/// A ray near another.
struct NearRay {
  int i = 0, j = 0;
  geometry::Ray ray;
  double distance = 0;  ///< the length of the chord
};

/// The cell of `ray` among `rays`. Its edges are indices of `found`, which gets all rays that are near enough, and some
/// more. Rays that are equal to `ray` or farther than 89.9 degrees away cut nothing. With `moved`, all rays are
/// displaced by up to 1e-5 of their distance, each always in the same way, so that no four are on one circle.
VoronoiCell voronoi_cell(const geometry::ScatteredRays& rays, const geometry::Ray& ray, bool moved,
                         std::vector<NearRay>& found);

/// Where voronoi_cell() displaces the ray of pixel (i, j) to.
geometry::Ray displaced(const geometry::ScatteredRays& rays, int i, int j);

}  // namespace nodal::view
