#include "stitch/view/natural_neighbours.h"

#include <algorithm>

#include "stitch/view/voronoi_cell.h"

namespace nodal::view {

std::vector<Neighbour> natural_neighbours(const geometry::ScatteredRays& rays, const geometry::Ray& ray) {
  std::vector<NearRay> found;
  const VoronoiCell cell = voronoi_cell(rays, ray, false, found);
  const auto nearest = std::ranges::min_element(found, {}, &NearRay::distance);
  std::vector<Neighbour> neighbours;
  double sum = 0;
  const std::vector<VoronoiCell::Corner>& corners = cell.corners();
  for (std::size_t k = 0; k < corners.size() && nearest->distance >= 1e-9; ++k) {
    if (corners[k].edge == VoronoiCell::kNobody) continue;
    const NearRay& other = found[static_cast<std::size_t>(corners[k].edge)];
    const double weight = (corners[(k + 1) % corners.size()].at - corners[k].at).norm() / other.distance;
    if (weight > 0) neighbours.push_back({other.i, other.j, weight});
    sum += weight;
  }
  // Its own ray, or one ray in all.
  if (sum == 0) return {{nearest->i, nearest->j, 1}};
  for (Neighbour& neighbour : neighbours) neighbour.weight /= sum;
  return neighbours;
}

}  // namespace nodal::view
