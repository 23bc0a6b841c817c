#include "stitch/table/seam_scores.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>

#include "protocol/base/try.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {
namespace {

/// Whether the head sees all rays around this one, at the margin's distance.
bool sees_around(const RaySampler& rays, HeadIndex head, const geometry::Ray& ray, double margin) {
  constexpr int kDirections = 8;
  const Eigen::Vector3d across = ray.direction().unitOrthogonal(), down = ray.direction().cross(across);
  for (int k = 0; k < kDirections; ++k) {
    const double turn = 2 * std::numbers::pi * k / kDirections;
    const Eigen::Vector3d d = ray.direction() + std::tan(margin) * (std::cos(turn) * across + std::sin(turn) * down);
    if (!rays.sight(head, geometry::Ray::towards(d))) return false;
  }
  return true;
}

}  // namespace

Result<std::vector<std::vector<float>>> seam_scores(const Calibration& calibration,
                                                    std::span<const PixelFormat> head_formats,
                                                    PixelFormat raymap_format, int map_width) {
  NODAL_TRY_ASSIGN(const auto layout, geometry::make_layout("equirectangular", map_width, map_width / 2));
  NODAL_TRY_ASSIGN(const auto rays, RaySampler::make(calibration, *layout, raymap_format, head_formats, {}));
  const double margin = kMarginPixels * 2 * std::numbers::pi / map_width;
  const std::size_t heads = calibration.heads.size();
  const auto pixels = static_cast<std::size_t>(map_width * (map_width / 2));
  std::vector<std::vector<float>> scores(heads, std::vector<float>(pixels));
  for (std::size_t p = 0; p < pixels; ++p) {
    const int x = static_cast<int>(p) % map_width, y = static_cast<int>(p) / map_width;
    const geometry::Ray ray = *layout->ray(x + 0.5, y + 0.5);
    std::optional<std::size_t> best;
    bool any_inside = false;
    double best_score = 0;
    for (std::size_t h = 0; h < heads; ++h) {
      const auto head = static_cast<HeadIndex>(h);
      const auto seen = rays.sight(head, ray);
      if (!seen || !(seen->density < kEndless)) continue;
      const double score = score_of(*seen, rays.optics()[h].depth_per_px);
      if (!(score > 0)) continue;
      if (score > best_score) {
        best = h;
        best_score = score;
      }
      if (!sees_around(rays, head, ray, margin)) continue;
      scores[h][p] = static_cast<float>(score);
      any_inside = true;
    }
    if (best && !any_inside) scores[*best][p] = static_cast<float>(best_score);
  }
  return scores;
}

}  // namespace nodal::table
