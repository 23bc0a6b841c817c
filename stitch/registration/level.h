// One level of a registration: the rays of a raymap, and every head's pictures with a matching blur.
#pragma once

#include <memory>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/descent.h"
#include "stitch/registration/objective.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

struct LevelPlan {
  int width = 0;         ///< width of the raymap, px, as if it were equirectangular
  int level = 0;         ///< level of the pyramid
  double sigma_px = 0;   ///< standard deviation of the blur, in the level's pixels
  double margin_px = 0;  ///< distance kept from the region's edge, in the level's pixels
  bool focal = false, lens = false, aspect = false;
  bool share_lens = false;  ///< one lens is estimated for all heads
  Curvature curvature = Curvature::kOwn;
  int most_iterations = 10;
  double turn_rad = 0;  ///< the descent ends when all turns are smaller
};

/// Full-size pixels per radian of a typical head.
double pixels_per_radian(const std::vector<HeadState>& heads);

/// The levels, from coarse to fine. `deepest`: the coarsest level of the pyramids.
std::vector<LevelPlan> plan_levels(const std::vector<HeadState>& heads, const Options& options, int deepest);

/// Ownership: owns everything that its objective reads. Must not be moved.
class Level {
 public:
  enum class Pictures { kLight, kDetail };

  /// Leaves out rays that two heads cannot share even after turns of `slack_rad`.
  /// Errors: those of the layout.
  static Result<std::unique_ptr<Level>> make(const LevelPlan& plan, Pictures pictures,
                                             const std::vector<HeadPyramid>& pyramids,
                                             const std::vector<HeadState>& heads, const Options& options,
                                             double slack_rad, const parallel::Workers& workers);
  Level(const Level&) = delete;
  Level& operator=(const Level&) = delete;

  Objective& objective() { return *objective_; }
  /// The factor by which the sums contain less information than their solid angle suggests, because neighbouring rays
  /// see the same blurred pixels.
  double pixels_a_sample() const { return pixels_a_sample_; }

 private:
  Level() = default;
  std::vector<Tile> tiles_;
  std::vector<std::vector<Plane>> planes_;
  std::unique_ptr<Objective> objective_;
  double pixels_a_sample_ = 1;
};

}  // namespace nodal::registration
