#include "stitch/view/natural_neighbours.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/view/tangent.h"

namespace nodal::view {
namespace {

using geometry::Pixel;
using geometry::Ray;

/// The Voronoi cell of a ray, a convex polygon on the plane that touches the sphere there. A great circle is a line.
class VoronoiCell {
 public:
  static constexpr int kNobody = -1;

  /// A square of this half side.
  explicit VoronoiCell(double half) {
    for (const auto& [u, v] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
      corners_.push_back({{u * half, v * half}, kNobody});
    }
  }
  /// Cuts off what is nearer to another ray: toward . t > offset.
  void cut(const Eigen::Vector2d& toward, double offset, int other) {
    std::vector<Corner> kept;
    for (std::size_t k = 0; k < corners_.size(); ++k) {
      const Corner &a = corners_[k], &b = corners_[(k + 1) % corners_.size()];
      const double da = offset - toward.dot(a.at), db = offset - toward.dot(b.at);
      if (da >= 0) kept.push_back(a);
      if ((da >= 0) == (db >= 0)) continue;
      const Eigen::Vector2d at = a.at + da / (da - db) * (b.at - a.at);
      kept.push_back({at, da >= 0 ? other : a.edge});  // the edge that begins here
    }
    corners_ = std::move(kept);
  }
  /// The distance of the farthest corner.
  double radius() const {
    double most = 0;
    for (const Corner& corner : corners_) most = std::max(most, corner.at.norm());
    return most;
  }
  template <class Visit>
  void each_edge(const Visit& visit) const {
    for (std::size_t k = 0; k < corners_.size(); ++k) {
      if (corners_[k].edge == kNobody) continue;
      visit(corners_[k].edge, (corners_[(k + 1) % corners_.size()].at - corners_[k].at).norm());
    }
  }

 private:
  struct Corner {
    Eigen::Vector2d at;
    int edge;  ///< whose edge begins here
  };
  std::vector<Corner> corners_;
};

}  // namespace

std::vector<Neighbour> natural_neighbours(const geometry::ScatteredRays& rays, const Ray& ray) {
  const double pitch = std::sqrt(4 * std::numbers::pi / rays.width() / rays.height());
  const Tangent tangent = tangent_at(ray);
  std::vector<Neighbour> neighbours;
  for (double reach = 2.5 * pitch;; reach *= 1.6) {
    // Who is farther away than twice the cell's radius does not cut it.
    const bool all = reach >= std::numbers::pi;
    VoronoiCell cell(all ? 1e3 : std::tan(std::min(reach, 1.5)));
    std::vector<double> away;
    neighbours.clear();
    rays.visit(ray, reach, [&](int i, int j, const Ray& other) {
      const double distance = (other.direction() - ray.direction()).norm();
      neighbours.push_back({i, j, 0});
      away.push_back(distance);
      // (ray - other) . (ray + t) > 0 on the ray's side; 1 - ray . other = distance^2 / 2.
      const Eigen::Vector2d toward(other.direction().dot(tangent.right), other.direction().dot(tangent.down));
      if (distance > 1e-12) cell.cut(toward, distance * distance / 2, static_cast<int>(away.size()) - 1);
    });
    const auto nearest = std::ranges::min_element(away);
    const bool own = nearest != away.end() && *nearest < 1e-9;
    if (!own && !all && 2 * std::atan(cell.radius()) > reach) continue;
    double sum = 0;
    cell.each_edge([&](int k, double length) {
      const double weight = length / std::max(away[static_cast<std::size_t>(k)], 1e-12);
      neighbours[static_cast<std::size_t>(k)].weight += weight;
      sum += weight;
    });
    if (own || sum == 0) {  // the latter: one ray in all
      const Neighbour& only = neighbours[static_cast<std::size_t>(nearest - away.begin())];
      return {{only.i, only.j, 1}};
    }
    std::erase_if(neighbours, [](const Neighbour& neighbour) { return neighbour.weight == 0; });
    for (Neighbour& neighbour : neighbours) neighbour.weight /= sum;
    return neighbours;
  }
}

}  // namespace nodal::view
