// The first steps of registration and drift: the heads' states, the pictures' pyramids of light, and the levels.
#pragma once

#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/level.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

struct Prepared {
  std::vector<HeadState> heads;  ///< as the calibration has them
  std::vector<HeadPyramid> pyramids;
  std::vector<LevelPlan> plans;  ///< from coarse to fine
};

/// Errors: those of check_frames() and check_light(); kLensDomain.
Result<Prepared> prepare(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                         const Options& options, const parallel::Workers& workers);

}  // namespace nodal::registration
