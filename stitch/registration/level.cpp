#include "stitch/registration/level.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/registration/ray_set.h"

namespace nodal::registration {
namespace {

constexpr int kCoarsestWidth = 64;
constexpr double kCoarseSigma = 2.0, kFineSigma = 1.5;  // level px
constexpr double kDetailRatio = 4;                      // detail is what a blur wider by this factor removes

// Rays per pixel of a picture, by level. Fine levels have fewer rays than pixels, because pictures are blurred; coarse
// levels have more, because they are cheap.
double density_of(int level) { return level <= 1 ? 0.8 : level <= 3 ? 1.2 : 1.6; }

int rounded_width(double width) { return std::max(64, static_cast<int>(std::lround(width / 32)) * 32); }

LevelPlan plan_level(int level, int width, double per_radian, const Options& options) {
  LevelPlan plan;
  plan.level = level;
  plan.width = width;
  plan.sigma_px = level <= 2 ? kFineSigma : kCoarseSigma;
  // Close to the region's edge the blur lacks pixels, so a margin is left out; coarse levels are too small for a full
  // one.
  plan.margin_px = level <= 1 ? 2 * kFineSigma : 1.5;
  plan.focal = options.free != Free::kRotations && level <= 2;
  plan.lens = options.free == Free::kLens && level <= 1;
  if (options.free == Free::kLens && options.lens_far_off) {
    plan.focal = plan.lens = true;
    plan.share_lens = level >= 2;
  }
  plan.aspect = options.aspect && level <= 1;
  plan.share_lens = plan.share_lens || options.one_lens;
  plan.curvature = level <= 1 ? Curvature::kCommon : Curvature::kOwn;
  plan.most_iterations = level == 0 ? 15 : 12;
  // A coarse level ends at a thirtieth of a pixel, because the next level refines it; the finest at a thousandth.
  plan.turn_rad = (level == 0 ? 0.001 : 0.03 * (1 << level)) / per_radian;
  return plan;
}

std::vector<std::vector<Plane>> blurred_planes(const LevelPlan& plan, Level::Pictures pictures,
                                               const std::vector<HeadPyramid>& pyramids,
                                               const std::vector<HeadState>& heads, const parallel::Workers& workers) {
  std::vector<std::vector<Plane>> planes(heads.size());
  const double sigma = plan.sigma_px * (1 << plan.level) / pixels_per_radian(heads);
  workers.run(static_cast<int>(heads.size()), [&](int head) {
    const auto h = static_cast<std::size_t>(head);
    for (const Plane& plane : pyramids[h].levels[static_cast<std::size_t>(plan.level)]) {
      planes[h].push_back(blurred_in_angle(plane, plan.level, heads[h], sigma));
      if (pictures == Level::Pictures::kLight) continue;
      const Plane wide = blurred_in_angle(plane, plan.level, heads[h], sigma * kDetailRatio);
      std::vector<float>& values = planes[h].back().values;
      for (std::size_t k = 0; k < values.size(); ++k) values[k] -= wide.values[k];
    }
  });
  return planes;
}

}  // namespace

double pixels_per_radian(const std::vector<HeadState>& heads) {
  std::vector<double> all;
  all.reserve(heads.size());
  for (const HeadState& head : heads) all.push_back(head.edge_radius / head.edge_angle);
  std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
  return all[all.size() / 2];
}

std::vector<LevelPlan> plan_levels(const std::vector<HeadState>& heads, const Options& options, int deepest) {
  const double per_radian = pixels_per_radian(heads), around = 2 * std::numbers::pi * per_radian;
  std::vector<LevelPlan> plans;
  for (int level = deepest; level >= 0; --level) {
    int width = rounded_width(around / (1 << level) * density_of(level));
    if (width < kCoarsestWidth && level > 0) continue;
    const bool last = options.width > 0 && (width >= options.width || level == 0);
    if (last) width = options.width;
    plans.push_back(plan_level(level, width, per_radian, options));
    if (last) break;
  }
  // The finest level must estimate all requested parameters.
  LevelPlan& finest = plans.back();
  finest.focal = options.free != Free::kRotations;
  finest.lens = options.free == Free::kLens;
  finest.aspect = options.aspect;
  finest.share_lens = options.one_lens;
  finest.curvature = Curvature::kCommon;
  finest.turn_rad = 0.001 / per_radian;
  return plans;
}

Result<std::unique_ptr<Level>> Level::make(const LevelPlan& plan, Pictures pictures,
                                           const std::vector<HeadPyramid>& pyramids,
                                           const std::vector<HeadState>& heads, const Options& options,
                                           double slack_rad, const parallel::Workers& workers) {
  NODAL_TRY_ASSIGN(const auto layout, layout_of_width(options.layout, plan.width));
  std::unique_ptr<Level> level(new Level);
  const std::vector<Cone> cones = cones_of(heads, slack_rad);
  level->tiles_ = make_tiles(*layout, workers, [&](const Tile& tile) { return shared_tile(tile, cones); });
  level->planes_ = blurred_planes(plan, pictures, pyramids, heads, workers);
  std::vector<std::vector<PlaneRef>> refs(heads.size());
  for (std::size_t h = 0; h < heads.size(); ++h) {
    for (const Plane& plane : level->planes_[h]) refs[h].push_back(plane.ref());
  }
  ObjectiveSettings settings;
  settings.max_norm = options.norm == Norm::kMax;
  settings.channels = options.colour == Colour::kRgb ? 3 : 1;
  const double scale = 1 << plan.level;
  level->objective_ =
      std::make_unique<Objective>(level->tiles_, std::move(refs), scale, plan.margin_px * scale, settings, workers);
  const double per_radian = pixels_per_radian(heads), ray = 2 * std::numbers::pi * per_radian / plan.width;
  const double blur = 4 * std::numbers::pi * std::pow(plan.sigma_px * scale, 2);
  level->pixels_a_sample_ = std::max(ray * ray, blur);
  return level;
}

}  // namespace nodal::registration
