#include "stitch/registration/lens_misfit.h"

#include "stitch/registration/descent.h"

namespace nodal::registration {

Result<double> promised_by(Objective& objective, const std::vector<HeadState>& heads, Sought sought, const Held& held,
                           Free free) {
  sought.focal = free != Free::kRotations;
  sought.lens = free == Free::kLens;
  const Result<Normal> here = objective.evaluate(heads, sought, true);
  if (!here) return fail(here.error());
  if (here->cost <= 0) return 0.0;
  const Parameters parameters(heads, sought, held);
  const Eigen::VectorXd step = step_to_minimum(parameters, heads, *here, Curvature::kOwn, 0);
  return -step.dot(parameters.gradient(*here)) / here->cost;
}

}  // namespace nodal::registration
