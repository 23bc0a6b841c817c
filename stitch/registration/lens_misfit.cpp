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
  const Eigen::VectorXd gradient = parameters.gradient(*here);
  return solve_symmetric(parameters.hessian(*here, Curvature::kOwn), gradient).dot(gradient) / here->cost;
}

}  // namespace nodal::registration
