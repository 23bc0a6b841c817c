#include "stitch/table/compile_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stitch/table/head_sight.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {
namespace {

// Steps, measured.
constexpr std::uint64_t kReach = 4;          ///< finding that a head does not see a ray
constexpr std::uint64_t kSight = 40;         ///< what a head sees of a ray, without masks
constexpr std::uint64_t kCorner = 4;         ///< a corner of a mask
constexpr std::uint64_t kExactLens = 1500;   ///< evaluating a lens where it cannot be looked up
constexpr std::uint64_t kSightsOfASeam = 3;  ///< beside a seam the slopes of the weights are evaluated, too
constexpr std::uint64_t kTables = 2;         ///< with seams: the raymap and its cover

/// The box of a mask, and its corners. Beyond a distance from the box, geometry::Masks does not look at the corners.
struct MaskBox {
  double left = 1e300, right = -1e300, top = 1e300, bottom = -1e300;
  std::uint64_t corners = 0;
  double distance(geometry::Pixel at) const { return std::max({left - at.x, at.x - right, top - at.y, at.y - bottom}); }
};
using MaskBoxes = std::vector<MaskBox>;

MaskBoxes boxes_of(const Region& region) {
  MaskBoxes boxes;
  for (const std::vector<Region::Point>& mask : region.masks) {
    MaskBox& box = boxes.emplace_back();
    box.corners = mask.size();
    for (const Region::Point& corner : mask) {
      box.left = std::min(box.left, corner.x);
      box.right = std::max(box.right, corner.x);
      box.top = std::min(box.top, corner.y);
      box.bottom = std::max(box.bottom, corner.y);
    }
  }
  return boxes;
}

struct SightCost {
  std::uint64_t steps = 0;  ///< 0: the ray is beyond the head's reach
  bool sees = false;        ///< it is in the head's region, and not masked
};

SightCost sight_cost(const geometry::Head& head, const MaskBoxes& masks, const HeadOptics& optics,
                     const geometry::Ray& ray) {
  const Eigen::Vector3d d = head.seen_from_here(ray.direction());
  const double ahead = optics.axis.dot(d);
  if (ahead < optics.cos_reach) return {};
  const Eigen::Vector3d in_head(optics.right.dot(d), optics.down.dot(d), ahead);
  SightCost cost{kSight, false};
  if (optics.lens.is_exact(std::hypot(in_head.x(), in_head.y()), ahead)) cost.steps += kExactLens;
  const auto seen = see(head, optics.lens, in_head, optics.depth_per_px);
  if (!seen) return cost;
  cost.sees = seen->inside >= kEdge;
  const double most = std::max(head.distance_to_edge_without_masks(seen->pixel), 1 / optics.depth_per_px);
  for (const MaskBox& mask : masks) cost.steps += mask.distance(seen->pixel) < most ? kCorner * mask.corners : 0;
  return cost;
}

}  // namespace

CompileCost compile_cost(const RaySampler& sampler) {
  CompileCost cost;
  const std::span<const geometry::Head> heads = sampler.heads();
  cost.heads.resize(heads.size());
  std::vector<MaskBoxes> masks;
  for (const geometry::Head& head : heads) masks.push_back(boxes_of(head.calibration().region));
  const RaySampler::Grid& grid = sampler.grids()[0];
  const double step = std::sqrt(static_cast<double>(grid.width) * grid.height / CompileCost::kRays);
  const bool seams = sampler.options().transition != Transition::kFeather;
  std::uint64_t rays = 0;
  for (double y = step / 2; y < grid.height; y += std::max(1.0, step)) {
    for (double x = step / 2; x < grid.width; x += std::max(1.0, step)) {
      ++rays;
      const auto ray = sampler.ray(0, std::floor(x), std::floor(y));
      if (!ray) continue;
      std::array<SightCost, kMaxHeads> sights;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        sights[h] = sight_cost(heads[h], masks[h], sampler.optics()[h], *ray);
      }
      const bool beside_seam = seams && std::ranges::count_if(sights, &SightCost::sees) > 1;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        cost.heads[h] += kReach + sights[h].steps * (beside_seam && sights[h].sees ? kSightsOfASeam : 1);
      }
    }
  }
  std::uint64_t samples = 0;
  for (const RaySampler::Grid& each : sampler.grids()) {
    samples += static_cast<std::uint64_t>(each.width) * static_cast<std::uint64_t>(each.height);
  }
  for (std::uint64_t& head : cost.heads) {
    head = head * (seams ? kTables : 1) * samples / std::max<std::uint64_t>(1, rays);
    cost.total += head;
  }
  return cost;
}

Status check_compile_budget(const CompileCost& cost, const Calibration& calibration, std::uint64_t pixels) {
  const std::size_t heads = cost.heads.size();
  const std::uint64_t budget = compile_budget(pixels, heads);
  if (cost.total <= budget) return {};
  const auto most = static_cast<std::size_t>(std::ranges::max_element(cost.heads) - cost.heads.begin());
  const HeadCalibration& head = calibration.heads[most];
  std::size_t corners = 0;
  for (const auto& mask : head.region.masks) corners += mask.size();
  const auto millions = [](std::uint64_t steps) { return std::to_string(steps / 1'000'000); };
  return fail(
      Errc::kTooLarge,
      fmt::format(
          "compiling the table needs {} million steps; allowed are {} million for a raymap of {} pixels and {} heads. "
          "Head '{}' costs most, {} %: its masks have {} corners; give them fewer, or its region a smaller area",
          millions(cost.total), millions(budget), pixels, heads, head.name,
          100 * cost.heads[most] / std::max<std::uint64_t>(1, cost.total), corners));
}

}  // namespace nodal::table
