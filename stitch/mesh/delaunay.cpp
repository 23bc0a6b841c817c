#include "stitch/mesh/delaunay.h"

#include <Eigen/Geometry>

#include "stitch/view/voronoi_cell.h"

namespace nodal::mesh {

std::vector<std::array<std::uint32_t, 3>> delaunay(const geometry::ScatteredRays& rays) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<view::NearRay> found;
  const auto width = static_cast<std::uint32_t>(rays.width());
  for (int j = 0; j < rays.height(); ++j) {
    for (int i = 0; i < rays.width(); ++i) {
      const auto own = static_cast<std::uint32_t>(j) * width + static_cast<std::uint32_t>(i);
      const geometry::Ray ray = view::displaced(rays, i, j);
      // Two edges of a Voronoi cell that follow each other: a triangle of three cells that meet.
      const view::VoronoiCell cell = view::voronoi_cell(rays, ray, true, found);
      const auto& corners = cell.corners();
      for (std::size_t k = 0; k < corners.size(); ++k) {
        const int one = corners[k].edge, next = corners[(k + 1) % corners.size()].edge;
        if (one == view::VoronoiCell::kNobody || next == view::VoronoiCell::kNobody) continue;
        const view::NearRay &a = found[static_cast<std::size_t>(one)], &b = found[static_cast<std::size_t>(next)];
        const auto index = [&](const view::NearRay& near) {
          return static_cast<std::uint32_t>(near.j) * width + static_cast<std::uint32_t>(near.i);
        };
        if (own > index(a) || own > index(b)) continue;  // found once, from the first of the three
        const bool inward = ray.direction().dot(a.ray.direction().cross(b.ray.direction())) < 0;
        triangles.push_back({own, inward ? index(a) : index(b), inward ? index(b) : index(a)});
      }
    }
  }
  return triangles;
}

}  // namespace nodal::mesh
