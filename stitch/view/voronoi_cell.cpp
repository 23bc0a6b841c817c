#include "stitch/view/voronoi_cell.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "stitch/view/tangent.h"

namespace nodal::view {
namespace {

double pitch_of(const geometry::ScatteredRays& rays) {
  return std::sqrt(4 * std::numbers::pi / rays.width() / rays.height());
}

/// A number in -1..1 that looks random (the finalizer of splitmix64).
double scrambled(std::uint64_t number) {
  number = (number ^ (number >> 30)) * 0xBF58'476D'1CE4'E5B9;
  number = (number ^ (number >> 27)) * 0x94D0'49BB'1331'11EB;
  return static_cast<double>((number ^ (number >> 31)) >> 11) * 0x1p-52 - 1;
}

}  // namespace

VoronoiCell::VoronoiCell(double half) {
  for (const auto& [u, v] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    corners_.push_back({{u * half, v * half}, kNobody});
}

void VoronoiCell::cut(const Eigen::Vector2d& toward, double offset, int other) {
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

double VoronoiCell::radius() const {
  double most = 0;
  for (const Corner& corner : corners_) most = std::max(most, corner.at.norm());
  return most;
}

geometry::Ray displaced(const geometry::ScatteredRays& rays, int i, int j) {
  const std::uint64_t number =
      3 * (static_cast<std::uint64_t>(j) * static_cast<std::uint64_t>(rays.width()) + static_cast<std::uint64_t>(i)) +
      1;
  const Eigen::Vector3d by(scrambled(number), scrambled(number + 1), scrambled(number + 2));
  return geometry::Ray::towards(rays.ray(i + 0.5, j + 0.5)->direction() + 1e-5 * pitch_of(rays) * by);
}

VoronoiCell voronoi_cell(const geometry::ScatteredRays& rays, const geometry::Ray& ray, bool moved,
                         std::vector<NearRay>& found) {
  const Tangent tangent = tangent_at(ray);
  for (double reach = 2.5 * pitch_of(rays);; reach *= 1.6) {
    // Who is farther away than twice the cell's radius does not cut it.
    const bool all = reach >= std::numbers::pi;
    VoronoiCell cell(all ? 1e3 : std::tan(std::min(reach, 1.5)));
    found.clear();
    rays.visit(ray, reach, [&](int i, int j, const geometry::Ray& its) {
      const geometry::Ray other = moved ? displaced(rays, i, j) : its;
      const double distance = (other.direction() - ray.direction()).norm();
      found.push_back({i, j, other, distance});
      // (ray - other) . (ray + t) > 0 on the ray's side; 1 - ray . other = distance^2 / 2.
      const Eigen::Vector2d toward(other.direction().dot(tangent.right), other.direction().dot(tangent.down));
      if (distance > 1e-12) cell.cut(toward, distance * distance / 2, static_cast<int>(found.size()) - 1);
    });
    if (all || 2 * std::atan(cell.radius()) <= reach) return cell;
  }
}

}  // namespace nodal::view
