// Levenberg-Marquardt (§4.4) on one level of the objective.
#pragma once

#include <functional>
#include <vector>

#include "stitch/registration/objective.h"
#include "stitch/registration/parameters.h"
#include "stitch/solve/symmetric.h"

namespace nodal::registration {

struct DescentOptions {
  Curvature curvature = Curvature::kOwn;
  int most_iterations = 25;
  double turn_rad = 3e-6;  ///< the descent ends with a step that turns every head by less than this,
  double gain = 2e-6;      ///< or that lowers the objective by a smaller fraction than this
  /// With it, changes of lenses since the start of the descent have soft priors (Parameters::lens_weights): the part of
  /// the objective's sum that noise alone adds for one independent sample. 0: none.
  double lens_noise = 0;
  /// After every accepted step (and before the first, as iteration 0): the objective and the largest turn, rad.
  std::function<void(int iteration, double objective, double turn)> accepted;
};

struct Descended {
  std::vector<HeadState> heads;
  Normal normal;  ///< at the result, with derivatives
  int iterations = 0;
};

/// A symmetric system of the objective's sums. Pivots below the rounding error of these sums count as zero.
solve::SymmetricSystem symmetric_system(const Eigen::MatrixXd& H);

/// The step to the minimum of a quadratic model with this matrix and gradient, with plausible fall-offs only; `damping`
/// is relative to each curvature.
Eigen::VectorXd step_to_minimum(const Parameters& parameters, const std::vector<HeadState>& heads,
                                const Eigen::MatrixXd& H, const Eigen::VectorXd& g, double damping);

/// Returns the best heads that were found. Errors: those of evaluating the start.
Result<Descended> descend(Objective& objective, std::vector<HeadState> heads, const Sought& sought, const Held& held,
                          const DescentOptions& options);

}  // namespace nodal::registration
