// The first steps of registration and drift: the pictures' pyramids of light, the heads' states, and the levels.
#pragma once

#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/level.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

struct Prepared {
  std::vector<HeadState> heads;  ///< as the calibration has them
  std::vector<LevelPlan> plans;  ///< from coarse to fine
};

/// Errors: kLensDomain.
Result<Prepared> prepare(const Calibration& calibration, const LitFrames& frames, const Options& options);

}  // namespace nodal::registration
