#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/blend/blend_table.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/ray_interpolation.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/seam.h"

namespace nodal::table {

std::span<const RaySample> RowSampler::at(int x) const {
  const auto i = static_cast<std::size_t>(x);
  const std::uint32_t begin = i == 0 ? 0 : ends_[i - 1];
  return std::span(samples_).subspan(begin, ends_[i] - begin);
}

void RowSampler::sample(int grid, int y) {
  begin(grid);
  const int width = rig_.grids()[static_cast<std::size_t>(grid)].width;
  for (int x = 0; x < width; ++x) add(rig_.ray(grid, x, y));
}

void RowSampler::sample(int grid, std::span<const std::uint32_t> places) {
  begin(grid);
  for (const std::uint32_t place : places) {
    const bool nowhere = place == blend::GridTable::kNowhere;
    add(nowhere ? std::nullopt : rig_.ray(grid, static_cast<int>(place & 0xffff), static_cast<int>(place >> 16)));
  }
}

void RowSampler::sample(int grid, std::span<const std::optional<geometry::Ray>> rays) {
  begin(grid);
  for (const std::optional<geometry::Ray>& ray : rays) add(ray);
}

void RowSampler::begin(int grid) {
  if (grid != grid_) {
    for (auto& rays : rays_) rays.clear();
    grid_ = grid;
  }
  ends_.clear();
  samples_.clear();
}

void RowSampler::add(const std::optional<geometry::Ray>& ray) {
  if (ray) {
    std::array<Sight, kMaxHeads> sights;
    const int count = find_sights(*ray, sights);
    for (int k = 0; k < count; ++k) samples_.push_back(place(sights[static_cast<std::size_t>(k)], *ray));
  }
  ends_.push_back(static_cast<std::uint32_t>(samples_.size()));
}

/// Fills in the heads that see the ray, with weights that sum to 1, and returns their number.
int RowSampler::find_sights(const geometry::Ray& ray, std::array<Sight, kMaxHeads>& sights) const {
  const std::span<const geometry::Head> heads = rig_.heads();
  const bool seams = rig_.options().transition != Transition::kFeather;
  std::size_t count = 0;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const std::optional<HeadSight> seen = rig_.sight(static_cast<HeadIndex>(h), ray);
    if (!seen) continue;
    const double weight = weight_of(*seen, seams, rig_.optics()[h].depth_per_px);
    if (!(weight > 0 && weight < kEndless)) continue;
    sights[count++] = {static_cast<HeadIndex>(h), seen->pixel, weight};
  }
  if (seams && count > 1 && !is_clear(std::span(sights).first(count))) {
    choose_best(ray, std::span(sights).first(count));
  }
  double sum = 0;
  for (std::size_t k = 0; k < count; ++k) sum += sights[k].weight;
  const double least = sum * rig_.options().least_weight;
  std::size_t kept = 0;
  double kept_sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (!(sights[k].weight > 0) || sights[k].weight < least) continue;
    kept_sum += sights[k].weight;
    sights[kept++] = sights[k];
  }
  const double share = 1 / kept_sum;
  for (std::size_t k = 0; k < kept; ++k) sights[k].weight *= share;
  return static_cast<int>(kept);
}

/// Whether the ray is so far from every seam that the best head has the whole weight, by the limits of the scores'
/// slopes. If so, sets the weights that choose_best() would set more slowly.
bool RowSampler::is_clear(std::span<Sight> sights) const {
  const double width = rig_.options().seam_width_deg * std::numbers::pi / 180;
  const auto best = std::ranges::max_element(sights, {}, &Sight::weight);
  const auto limits = [this](const Sight& one) {
    const double score = std::sqrt(one.weight);
    return ScoreLimits{score, score, rig_.steepest(one.head)};
  };
  for (const Sight& one : sights) {
    if (&one != &*best && !beyond_ramp(limits(*best), limits(one), width)) return false;
  }
  for (Sight& one : sights) one.weight = &one == &*best ? 1 : 0;
  return true;
}

/// Replaces the weights by those of apply_seam(). Scores are the square roots of the weights: a smoothstep rises with
/// the square of the distance from the edge, so its root is about linear, as apply_seam() needs for seams of the given
/// width.
void RowSampler::choose_best(const geometry::Ray& ray, std::span<Sight> sights) const {
  std::array<SeamCandidate, kMaxHeads> candidates;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    candidates[k].score = std::sqrt(sights[k].weight);
    candidates[k].slope = rig_.score_slope(sights[k].head, ray, candidates[k].score);
  }
  apply_seam(std::span(candidates).first(sights.size()), rig_.options().seam_width_deg * std::numbers::pi / 180);
  for (std::size_t k = 0; k < sights.size(); ++k) sights[k].weight = candidates[k].weight;
}

RaySample RowSampler::place(const Sight& sight, const geometry::Ray& ray) {
  RaySample sample = rig_.place(grid_, sight.head, sight.pixel);
  sample.weight = sight.weight;
  if (rig_.stays(grid_, sight.head, sight.pixel)) return sample;

  const RaySampler::Plane& picture = rig_.plane(grid_, sight.head);
  const auto x = std::min(static_cast<std::int32_t>(sample.x), picture.width - 2);
  const auto y = std::min(static_cast<std::int32_t>(sample.y), picture.height - 2);
  std::array<Eigen::Vector3d, 4> neighbours;
  for (std::int32_t k = 0; k < 4; ++k) {
    const CachedRay& neighbour = ray_of(sight.head, x + (k & 1), y + (k >> 1));
    if (!neighbour.exists) return sample;  // beyond the lens: there is no ray to interpolate
    neighbours[static_cast<std::size_t>(k)] = neighbour.direction;
  }
  const Fractions at = ray_fractions(TangentPlane(ray.direction()), neighbours, {sample.x - x, sample.y - y});
  sample.x = x + at.x;
  sample.y = y + at.y;
  return sample;
}

const RowSampler::CachedRay& RowSampler::ray_of(HeadIndex head, std::int32_t x, std::int32_t y) {
  // A direct-mapped cache: the rays of a raymap row lie on a curve in the picture, those of the next row close to it.
  constexpr std::int32_t kColumns = 1024;
  constexpr std::int32_t kRows = 8;
  std::vector<CachedRay>& rays = rays_[head];
  if (rays.empty()) rays.resize(static_cast<std::size_t>(kColumns) * kRows);
  CachedRay& cached = rays[static_cast<std::size_t>((x & (kColumns - 1)) + (y & (kRows - 1)) * kColumns)];
  if (cached.x == x && cached.y == y) return cached;
  const PlaneGrid& plane_grid = rig_.plane(grid_, head).on_picture;
  const geometry::Pixel pixel{(x + 0.5 - plane_grid.offset_x) * plane_grid.step_x,
                              (y + 0.5 - plane_grid.offset_y) * plane_grid.step_y};
  const std::optional<Eigen::Vector3d> direction = unproject(head, pixel);
  cached.x = x;
  cached.y = y;
  cached.exists = direction.has_value();
  if (direction) cached.direction = *direction;
  return cached;
}

/// Head::unproject, from lookup tables.
std::optional<Eigen::Vector3d> RowSampler::unproject(HeadIndex head, geometry::Pixel pixel) const {
  const geometry::Head& h = rig_.heads()[head];
  const double x = pixel.x - h.calibration().center_x;
  const double y = (pixel.y - h.calibration().center_y) / h.calibration().aspect;
  const double r = std::sqrt(x * x + y * y);
  const std::optional<double> a = rig_.optics()[head].lens.angle(r);
  if (!a) return std::nullopt;
  const double across = r > 0 ? std::sin(*a) / r : 0;
  const Eigen::Vector3d d(across * x, across * y, std::cos(*a));
  const Eigen::Matrix3d& R = h.R_head_rig();
  return h.seen_from_rig(Eigen::Vector3d(R.col(0).dot(d), R.col(1).dot(d), R.col(2).dot(d)));
}

}  // namespace nodal::table
