#include "stitch/registration/lens_misfit.h"

#include <algorithm>

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

Result<Parallax> parallax_in(Objective& objective, const std::vector<HeadState>& heads, Sought sought,
                             const Held& held) {
  if (std::ranges::all_of(heads, [](const HeadState& head) { return head.position.isZero(0); })) return Parallax{};
  sought.nearness = true;
  const Result<Normal> here = objective.evaluate(heads, sought, true);
  if (!here) return fail(here.error());
  if (here->cost <= 0) return Parallax{};
  const Parameters parameters(heads, sought, held);
  const Eigen::VectorXd step = step_to_minimum(parameters, heads, *here, Curvature::kOwn, 0);
  return Parallax{-step.dot(parameters.gradient(*here)) / here->cost, parameters.moved(heads, step).front().nearness};
}

}  // namespace nodal::registration
