// What a run estimates on each of its levels.
#pragma once

#include <algorithm>
#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/level.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

inline int channels_of(const Options& options) { return options.colour == Colour::kRgb ? 3 : 1; }
inline bool is_coarse(const LevelPlan& plan) { return plan.level >= 2; }
inline bool lenses_far_off(const Options& options) {
  return options.lens_far_off && options.free == Free::kLens && options.geometry;
}
/// The level on which detail is measured: not the finest, because full-size pictures are noisy.
inline const LevelPlan& detail_plan(const std::vector<LevelPlan>& plans) {
  return plans[plans.back().level == 0 && plans.size() > 1 ? plans.size() - 2 : plans.size() - 1];
}
inline Sought sought_of(const LevelPlan& plan, const Options& options) {
  Sought sought;
  sought.rotation = options.geometry;
  sought.focal = plan.focal && options.geometry;
  sought.lens = plan.lens && options.geometry;
  sought.aspect = plan.aspect && options.geometry;
  sought.nearness = options.distance && options.geometry;
  sought.gain = options.gains;
  sought.vignetting = options.vignetting != VignettingModel::kFixed;
  sought.channels = channels_of(options);
  return sought;
}

/// How much of a run's work is done, for its reports of progress.
class RunWork {
 public:
  RunWork() = default;
  RunWork(const std::vector<LevelPlan>& plans, const Options& options) {
    all_ = 0;
    for (const LevelPlan& plan : plans) {
      const bool twice = lenses_far_off(options) && !is_coarse(plan) && &plan != &plans.back();
      all_ += (twice ? 2.0 : 1.0) * of(plan);
    }
  }
  /// The coarse levels begin again.
  void restart() { done_ = 0; }
  void end_level(const LevelPlan& plan) { done_ += of(plan); }
  /// The share that is done after an iteration of a level, 0 to 1.
  double share(const LevelPlan& plan, int iteration) const {
    return std::min(1.0, (done_ + std::min(1.0, iteration / 6.0) * of(plan)) / all_);
  }

 private:
  static double of(const LevelPlan& plan) { return static_cast<double>(plan.width) * plan.width; }

  double done_ = 0, all_ = 1;
};

}  // namespace nodal::registration
