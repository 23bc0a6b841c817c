// Levenberg-Marquardt (§4.4), used by every least-squares fit.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <utility>
#include <vector>

#include "stitch/solve/normal_equations.h"

namespace nodal::solve {

struct DescentOptions {
  int most_steps = 50;          ///< steps tried, including refused ones
  int most_refusals = 100;      ///< refused steps in a row
  double enough = 1e-6;         ///< ends when a step lowers, or is predicted to lower, the cost by a smaller share
  double sure = 0;              ///< a step with a smaller predicted share is taken without evaluation, and is the last
  double first_damping = 1e-4;  ///< lambda in the paper
  double least_damping = 0;     ///< accepted steps divide the damping by ten, but not below this
  double most_damping = 1e4;    ///< refused steps multiply it by ten; above this the descent ends
};

template <class State, class Evaluation>
struct Descent {
  State state;
  Evaluation at;         ///< the evaluation of `state`; of the previous state if the last step was not evaluated
  int tried = 0;         ///< steps evaluated
  int steps = 0;         ///< steps accepted
  bool settled = false;  ///< whether it ended because the cost no longer decreases
};

/// The interface of a problem. An Evaluation holds the cost of a state and its derivatives; an infinite or
/// NaN cost marks an invalid state. evaluate() must not depend on earlier states, except through
/// reweigh().
template <class P, class State, class Evaluation>
concept Problem = requires(P& problem, const State& state, const Evaluation& at, const Eigen::VectorXd& step) {
  { problem.evaluate(state) } -> std::same_as<Evaluation>;
  { problem.cost(at) } -> std::convertible_to<double>;
  { problem.step(state, at, 0.1) } -> std::convertible_to<Eigen::VectorXd>;
  { problem.promised(at, step) } -> std::convertible_to<double>;  // predicted share of the cost
  { problem.moved(state, step) } -> std::same_as<State>;
};

/// One step, for a problem with its own rules of acceptance.
template <class State, class Evaluation>
struct Trial {
  const State& state;           ///< the state after the step
  const Evaluation& candidate;  ///< its evaluation
  const Evaluation& here;
  const Eigen::VectorXd& step;
  double promised = 0;      ///< predicted share of the cost
  double next_damping = 0;  ///< damping of the next step, if this one is accepted
};

/// Descends from `start`, whose evaluation is `at`, to a state of least cost; the best state so far is kept. A problem
/// may also define:
///   accepts(Trial)            replaces the rule "the cost is lower"
///   ends(Trial, accepted)     a further reason to end after a step
///   reweigh(state)            new weights or a new scale after an accepted step; the cost is then evaluated again
template <class State, class Evaluation, class P>
requires Problem<P, State, Evaluation> Descent<State, Evaluation> descend_from(State start, Evaluation at, P& problem,
                                                                               const DescentOptions& options) {
  Descent<State, Evaluation> best{std::move(start), std::move(at)};
  if (!std::isfinite(problem.cost(best.at))) return best;
  double damping = options.first_damping;
  int refusals = 0;
  while (best.tried < options.most_steps) {
    const Eigen::VectorXd step = problem.step(best.state, best.at, damping);
    const double promised = problem.promised(best.at, step);
    best.settled = step.size() == 0 || promised < options.enough;
    if (best.settled) break;
    State next = problem.moved(best.state, step);
    if (promised < options.sure) {
      best.state = std::move(next);
      best.settled = true;
      break;
    }
    Evaluation candidate = problem.evaluate(next);
    ++best.tried;
    const double next_damping = std::max(damping / 10, options.least_damping);
    const Trial<State, Evaluation> trial{next, candidate, best.at, step, promised, next_damping};
    bool accepted = false, ends = false;
    if constexpr (requires { problem.accepts(trial); }) accepted = problem.accepts(trial);
    else accepted = problem.cost(candidate) < problem.cost(best.at);
    if constexpr (requires { problem.ends(trial, accepted); }) ends = problem.ends(trial, accepted);
    if (!accepted) {
      constexpr double kMinAfterRefusal = 1e-9;  // from almost zero, raising the damping would take many refusals
      damping = std::max(10 * damping, kMinAfterRefusal);
      best.settled = ends || ++refusals >= options.most_refusals || damping > options.most_damping;
      if (best.settled) break;
      continue;
    }
    const double gain = 1 - problem.cost(candidate) / problem.cost(best.at);
    best.state = std::move(next);
    best.at = std::move(candidate);
    ++best.steps;
    damping = next_damping;
    refusals = 0;
    if constexpr (requires { problem.reweigh(best.state); }) {
      problem.reweigh(best.state);
      best.at = problem.evaluate(best.state);
    }
    best.settled = ends || gain < options.enough;
    if (best.settled) break;
  }
  return best;
}

/// Normal equations and their cost; with a robust norm the cost differs from the weighted sum of squares.
struct Evaluation {
  NormalEquations equations;
  double cost = 0;

  void add(const Evaluation& other) {
    equations.add(other.equations);
    cost += other.cost;
  }
};

/// The cost of an invalid state.
inline constexpr double kImpossible = std::numeric_limits<double>::infinity();

/// A problem of normal equations: evaluate(state) -> Evaluation, moved(state, step) -> State. `fixed` marks the
/// unknowns that are held (empty: none).
template <class State, class Evaluate, class Move>
struct NormalProblem {
  Evaluate evaluate;
  Move moved;
  std::vector<bool> fixed;

  double cost(const Evaluation& at) const { return at.cost; }
  Eigen::VectorXd step(const State&, const Evaluation& at, double damping) const {
    return at.equations.step(damping, fixed);
  }
  double promised(const Evaluation& at, const Eigen::VectorXd& step) const { return at.equations.promised_by(step); }
};

/// The same with weights that depend on the state: reweigh(state) is called at the start and after every accepted step.
template <class State, class Evaluate, class Move, class Reweigh>
struct ReweightedProblem : NormalProblem<State, Evaluate, Move> {
  Reweigh reweigh;
};

template <class State, class Evaluate, class Move>
Descent<State, Evaluation> descend(State start, Evaluate evaluate, Move moved, const std::vector<bool>& fixed,
                                   const DescentOptions& options) {
  NormalProblem<State, Evaluate, Move> problem{std::move(evaluate), std::move(moved), fixed};
  Evaluation at = problem.evaluate(start);
  return descend_from(std::move(start), std::move(at), problem, options);
}

template <class State, class Evaluate, class Move, class Reweigh>
Descent<State, Evaluation> descend_reweighted(State start, Evaluate evaluate, Move moved, Reweigh reweigh,
                                              const DescentOptions& options) {
  ReweightedProblem<State, Evaluate, Move, Reweigh> problem{{std::move(evaluate), std::move(moved), {}},
                                                            std::move(reweigh)};
  problem.reweigh(start);
  Evaluation at = problem.evaluate(start);
  return descend_from(std::move(start), std::move(at), problem, options);
}

}  // namespace nodal::solve
