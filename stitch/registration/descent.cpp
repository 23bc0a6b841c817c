#include "stitch/registration/descent.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/solve/levenberg_marquardt.h"

namespace nodal::registration {
namespace {

constexpr double kFirstDamping = 1e-4, kMinDamping = 1e-9;  // the first is the paper's
constexpr int kMaxRefusals = 4;
// Fall-offs are far from linear. Without rotations, no finer level would go on from here.
constexpr int kMaxRefusalsOfLight = 10;
constexpr double kGrain = 2e-4;  // relative noise of the objective, from rays that enter and leave at the rims
// A step that raises the objective by less than this factor may still be accepted.
constexpr double kSameObjective = 1.001;
constexpr double kMinPivot = 1e-9;  // sums are of single-precision products: smaller pivots are rounding errors

/// Keeps the distance between infinity and the nearest one that a calibration may have.
void bound_nearness(const Parameters& parameters, const std::vector<HeadState>& heads,
                    std::vector<solve::Bound>& bounds) {
  const int slot = parameters.slots().front().nearness;
  if (slot < 0) return;
  double farthest = 0;
  for (const HeadState& head : heads) farthest = std::max(farthest, head.position.norm());
  const Eigen::VectorXd row = parameters.basis().row(slot).transpose();
  bounds.push_back({row, std::max(0.0, 1 / (farthest * kMinDistancePerPosition) - heads.front().nearness)});
  bounds.push_back({-row, heads.front().nearness});
}

/// Bounds on a step that keep every head's fall-off plausible at a few radii.
std::vector<solve::Bound> bounds_of(const Parameters& parameters, const std::vector<HeadState>& heads) {
  std::vector<solve::Bound> bounds;
  bound_nearness(parameters, heads, bounds);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const int slot = parameters.slots()[h].vignetting;
    // Not for a head that starts outside these bounds.
    if (slot < 0 || !plausible_fall_off(heads[h].vignetting)) continue;
    const Eigen::Index first = static_cast<Eigen::Index>(h) * parameters.stride() + slot;
    for (const double s : kFallOffPlaces) {
      const Eigen::VectorXd row =
          (s * parameters.basis().row(first) + s * s * parameters.basis().row(first + 1)).transpose();
      if (row.isZero()) continue;
      const double now = light_left(heads[h].vignetting, s);
      bounds.push_back({row, std::max(kMaxLight - now, 0.0)});
      bounds.push_back({-row, std::max(now - kMinLight, 0.0)});
    }
  }
  return bounds;
}

/// The heads, and by how much their free parameters differ from the start of the descent.
struct State {
  std::vector<HeadState> heads;
  Eigen::VectorXd change;
};
/// The sums with what soft priors add to them.
struct Evaluated {
  Normal normal;
  Eigen::VectorXd prior_gradient;
  double prior_cost = 0;
};
/// Nothing where a lens is not monotonic over its region.
using Evaluation = std::optional<Evaluated>;
using Trial = solve::Trial<State, Evaluation>;

class LevelProblem {
 public:
  LevelProblem(Objective& objective, const Parameters& parameters, const std::vector<HeadState>& start,
               const Sought& sought, const DescentOptions& options)
      : objective_(objective),
        parameters_(parameters),
        sought_(sought),
        options_(options),
        weights_(options.lens_noise * parameters.lens_weights(start)) {}

  Evaluated with_priors(Normal normal, const State& state) const {
    Eigen::VectorXd gradient = weights_ * state.change;
    const double cost = state.change.dot(gradient);
    return {std::move(normal), std::move(gradient), cost};
  }
  Evaluation evaluate(const State& state) {
    Result<Normal> normal = objective_.evaluate(state.heads, sought_, true);
    return normal ? Evaluation(with_priors(std::move(*normal), state)) : std::nullopt;
  }
  double cost(const Evaluation& at) const {
    return at ? at->normal.objective() + at->prior_cost / at->normal.measure : solve::kImpossible;
  }
  Eigen::VectorXd step(const State& state, const Evaluation& at, double damping) const {
    return step_to_minimum(parameters_, state.heads, parameters_.hessian(at->normal, options_.curvature) + weights_,
                           gradient(at), damping);
  }
  double promised(const Evaluation& at, const Eigen::VectorXd& step) const {
    return -step.dot(gradient(at)) / (at->normal.cost + at->prior_cost);
  }
  State moved(const State& state, const Eigen::VectorXd& step) const {
    return {parameters_.moved(state.heads, step), state.change + step};
  }

  bool accepts(const Trial& trial) {
    if (!refused_) promised_ = trial.promised;
    const double here = cost(trial.here),
                 candidate = cost(trial.candidate);  // infinite without a value: never accepted
    if (candidate < here) return true;
    if (options_.curvature != Curvature::kCommon || !(candidate < here * kSameObjective)) return false;
    // The derivative treats the weights as constant, the objective does not, so near the end the zero of the derivative
    // is not exactly the minimum of the objective. There a step is accepted if it halves the predicted decrease of the
    // next step, which is 0 where the derivative is 0.
    const Eigen::VectorXd next = step(trial.state, trial.candidate, trial.next_damping);
    return promised(trial.candidate, next) < 0.5 * promised_;
  }
  bool ends(const Trial& trial, bool accepted) {
    ++tried_;
    refused_ = !accepted;
    const double turn = parameters_.largest_turn(trial.step);
    const bool still = sought_.rotation && turn < options_.turn_rad;
    if (!accepted) return still || promised_ < kGrain;
    if (options_.accepted) options_.accepted(tried_, trial.candidate->normal.objective(), turn);
    const double share = 1 - cost(trial.candidate) / cost(trial.here);
    return still || (options_.curvature == Curvature::kOwn && share < options_.gain);
  }

 private:
  Eigen::VectorXd gradient(const Evaluation& at) const { return parameters_.gradient(at->normal) + at->prior_gradient; }

  Objective& objective_;
  const Parameters& parameters_;
  const Sought& sought_;
  const DescentOptions& options_;
  const Eigen::MatrixXd weights_;  // weights of the soft priors
  int tried_ = 0;
  bool refused_ = false;  // the latest step
  double promised_ = 0;   // the decrease that the first step from the best heads predicted
};

}  // namespace

solve::SymmetricSystem symmetric_system(const Eigen::MatrixXd& H) { return {H, {}, {.least_pivot = kMinPivot}}; }

Eigen::VectorXd step_to_minimum(const Parameters& parameters, const std::vector<HeadState>& heads,
                                const Eigen::MatrixXd& H, const Eigen::VectorXd& g, double damping) {
  return solve::solve_bounded(H, -g, bounds_of(parameters, heads), {.damping = damping, .least_pivot = kMinPivot});
}

Result<Descended> descend(Objective& objective, std::vector<HeadState> heads, const Sought& sought, const Held& held,
                          const DescentOptions& options) {
  const Parameters parameters(heads, sought, held);
  NODAL_TRY_ASSIGN(Normal start, objective.evaluate(heads, sought, true));
  if (options.accepted) options.accepted(0, start.objective(), 0);
  LevelProblem problem(objective, parameters, heads, sought, options);
  State first{std::move(heads), Eigen::VectorXd::Zero(parameters.free_count())};
  Evaluation at = problem.with_priors(std::move(start), first);
  constexpr double kNever = -std::numeric_limits<double>::infinity();
  auto end = solve::descend_from(std::move(first), std::move(at), problem,
                                 {.most_steps = options.most_iterations,
                                  .most_refusals = sought.rotation ? kMaxRefusals : kMaxRefusalsOfLight,
                                  .enough = kNever,  // ends() ends the descent
                                  .sure = kNever,
                                  .first_damping = kFirstDamping,
                                  .least_damping = kMinDamping,
                                  .most_damping = solve::kImpossible});
  return Descended{std::move(end.state.heads), std::move(end.at->normal), end.tried};
}

}  // namespace nodal::registration
