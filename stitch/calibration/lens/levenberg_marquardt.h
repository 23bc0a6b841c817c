// Levenberg-Marquardt (§4.4) over any state that knows its cost, its normal equations and how to take a step.
#pragma once

#include <utility>
#include <vector>

#include "stitch/calibration/lens/normal_equations.h"

namespace nodal::calibration {

struct Evaluation {
  NormalEquations equations;
  double cost = 0;
};

struct DescentOptions {
  int most_steps = 50;
  double enough = 1e-6;        ///< ends when a step lowers the cost, or promises to, by less than this part of it
  double sure = 0;             ///< a step that promises less than this part of the cost is taken unseen, as the last
  double first_damping = 1e-4; ///< the paper's lambda
};

template <class State>
struct Descent {
  State state;
  Evaluation at;   ///< the evaluation of `state`, or of the one before a step taken unseen
  int steps = 0;   ///< those seen to lower the cost
  bool settled = false;
};

/// evaluate(state) -> Evaluation; moved(state, step) -> State. The best state so far is kept, as the paper
/// does.
template <class State, class Evaluate, class Move>
Descent<State> descend(State start, Evaluate&& evaluate, Move&& moved, const std::vector<bool>& fixed,
                       const DescentOptions& options) {
  Evaluation at = evaluate(start);
  Descent<State> best{std::move(start), std::move(at)};
  double damping = options.first_damping;
  for (int n = 0; n < options.most_steps; ++n) {
    const Eigen::VectorXd step = best.at.equations.step(damping, fixed);
    const double promised = best.at.equations.promised_by(step);
    best.settled = promised < options.enough;
    if (best.settled) break;
    State next = moved(best.state, step);
    if (promised < options.sure) {
      best.state = std::move(next);
      best.settled = true;
      break;
    }
    Evaluation evaluation = evaluate(next);
    if (!(evaluation.cost < best.at.cost)) {
      damping = damping * 10 + 1e-9;
      best.settled = damping > 1e4;
      if (best.settled) break;
      continue;
    }
    const double gain = (best.at.cost - evaluation.cost) / best.at.cost;
    best.state = std::move(next);
    best.at = std::move(evaluation);
    ++best.steps;
    damping /= 10;
    best.settled = gain < options.enough;
    if (best.settled) break;
  }
  return best;
}

}  // namespace nodal::calibration
