#include "stitch/registration/descent.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace nodal::registration {
namespace {

constexpr double kFirstDamping = 1e-4, kLeastDamping = 1e-9;  // the first is the paper's
constexpr int kMostRefusals = 4;
constexpr double kGrain = 2e-4;  // of the objective: what rays that come and go at the rims make of it, up or down
constexpr double kLeastPivot = 1e-9;

// row . step <= room keeps a head's fall-off plausible at one place.
struct Bound {
  Eigen::VectorXd row;
  double room = 0;
};

std::vector<Bound> bounds_of(const Parameters& parameters, const std::vector<HeadState>& heads) {
  std::vector<Bound> bounds;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const int slot = parameters.slots()[h].vignetting;
    // One that starts outside goes where it wants.
    if (slot < 0 || !plausible_fall_off(heads[h].vignetting)) continue;
    const Eigen::Index first = static_cast<Eigen::Index>(h) * parameters.stride() + slot;
    for (const double s : kFallOffPlaces) {
      const Eigen::VectorXd row =
          (s * parameters.basis().row(first) + s * s * parameters.basis().row(first + 1)).transpose();
      if (row.isZero()) continue;
      const double now = light_left(heads[h].vignetting, s);
      bounds.push_back({row, std::max(kMostLight - now, 0.0)});
      bounds.push_back({-row, std::max(now - kLeastLight, 0.0)});
    }
  }
  return bounds;
}

// The multipliers >= 0 of a quadratic problem's bounds, by Hildreth's sweeps: each in turn to where its own bound is met.
Eigen::VectorXd multipliers_of(const Eigen::MatrixXd& gram, const Eigen::VectorXd& crossed) {
  constexpr int kMostSweeps = 2000;
  Eigen::VectorXd multipliers = Eigen::VectorXd::Zero(crossed.size());
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double beyond = 0;
    for (Eigen::Index k = 0; k < crossed.size(); ++k) {
      const double left = crossed[k] - gram.row(k).dot(multipliers);
      const double next = gram(k, k) > 0 ? std::max(0.0, multipliers[k] + left / gram(k, k)) : 0.0;
      beyond = std::max(beyond, std::abs(next - multipliers[k]) * gram(k, k));
      multipliers[k] = next;
    }
    if (beyond < 1e-9) break;
  }
  return multipliers;
}

}  // namespace

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& H, const Eigen::VectorXd& g) {
  // Unit diagonal first: px, radians and logarithms differ by orders of magnitude, and a pivot's size means nothing
  // before they do not.
  Eigen::VectorXd scale(H.rows());
  for (Eigen::Index k = 0; k < H.rows(); ++k) scale[k] = H(k, k) > 0 ? 1 / std::sqrt(H(k, k)) : 0.0;
  const Eigen::MatrixXd unit = scale.asDiagonal() * H * scale.asDiagonal();
  const Eigen::VectorXd right = scale.asDiagonal() * g;
  const Eigen::LDLT<Eigen::MatrixXd> cholesky(unit);
  if (cholesky.info() == Eigen::Success && cholesky.vectorD().minCoeff() > kLeastPivot) {
    return scale.asDiagonal() * cholesky.solve(right);
  }
  // Symmetric, so its eigenvalues are its singular values up to sign; a negative one is noise and is left out too.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit);
  Eigen::VectorXd inverse = eigen.eigenvalues();
  for (double& each : inverse) each = each > kLeastPivot ? 1 / each : 0.0;
  return scale.asDiagonal() *
         (eigen.eigenvectors() * (inverse.asDiagonal() * (eigen.eigenvectors().transpose() * right)));
}

Eigen::VectorXd step_to_minimum(const Parameters& parameters, const std::vector<HeadState>& heads, const Normal& normal,
                                Curvature curvature, double damping) {
  Eigen::MatrixXd H = parameters.hessian(normal, curvature);
  H.diagonal() *= 1 + damping;
  const Eigen::VectorXd free = -solve_symmetric(H, parameters.gradient(normal));
  Eigen::VectorXd step = free;
  std::vector<Bound> bounds = bounds_of(parameters, heads);
  Eigen::MatrixXd rows(0, step.size()), toward(step.size(), 0);  // of the bounds met so far
  Eigen::VectorXd crossed(0);
  while (true) {
    constexpr double kTouched = 1e-8;
    const auto beyond = [&](const Bound& bound) { return bound.row.dot(step) - bound.room; };
    const auto worst = std::ranges::max_element(bounds, {}, beyond);
    if (worst == bounds.end() || beyond(*worst) <= kTouched) return step;
    const Eigen::Index n = rows.rows();
    rows.conservativeResize(n + 1, Eigen::NoChange);
    rows.row(n) = worst->row.transpose();
    toward.conservativeResize(Eigen::NoChange, n + 1);
    toward.col(n) = solve_symmetric(H, worst->row);
    crossed.conservativeResize(n + 1);
    crossed[n] = worst->row.dot(free) - worst->room;
    bounds.erase(worst);
    step = free - toward * multipliers_of(rows * toward, crossed);
  }
}

Result<Descended> descend(Objective& objective, std::vector<HeadState> heads, const Sought& sought,
                          const Held& held, const DescentOptions& options) {
  const Parameters parameters(heads, sought, held);
  Result<Normal> start = objective.evaluate(heads, sought, true);
  if (!start) return fail(start.error());
  Descended best{std::move(heads), std::move(*start), 0};
  if (options.accepted) options.accepted(0, best.normal.objective(), 0);
  double damping = kFirstDamping;
  int refusals = 0;
  const auto step_from = [&](const std::vector<HeadState>& from, const Normal& normal, double lambda) {
    const Eigen::VectorXd step = step_to_minimum(parameters, from, normal, options.curvature, lambda);
    return std::pair{step, -step.dot(parameters.gradient(normal)) / normal.cost};
  };
  auto [step, promised] = step_from(best.heads, best.normal, damping);
  while (best.iterations < options.most_iterations && refusals < kMostRefusals && parameters.free_count() > 0) {
    const double turn = parameters.largest_turn(step);
    const bool still = sought.rotation && turn < options.turn_rad;
    std::vector<HeadState> tried = parameters.moved(best.heads, step);
    Result<Normal> there = objective.evaluate(tried, sought, true);
    ++best.iterations;
    const double next_damping = std::max(damping / 10, kLeastDamping);
    // A lens that no longer rises is a refusal like any other.
    bool better = there && there->objective() < best.normal.objective();
    auto [next_step, next_promised] = there ? step_from(tried, *there, next_damping) : std::pair{step, promised};
    // The derivative holds the weights still, the objective does not: near the end the one's zero is not quite the
    // other's minimum. There the promise of the next step, which the derivative's zero takes to nothing, decides.
    if (there && options.curvature == Curvature::kCommon && next_promised < 0.5 * promised &&
        there->objective() < best.normal.objective() * 1.001) better = true;
    if (!better) {
      damping *= 10;
      ++refusals;
      if (still || promised < kGrain) break;
      step = step_from(best.heads, best.normal, damping).first;
      continue;
    }
    const double share = 1 - there->objective() / best.normal.objective();
    best.heads = std::move(tried);
    best.normal = std::move(*there);
    damping = next_damping;
    refusals = 0;
    if (options.accepted) options.accepted(best.iterations, best.normal.objective(), turn);
    if (still || (options.curvature == Curvature::kOwn && share < options.gain)) break;
    step = next_step;
    promised = next_promised;
  }
  return best;
}

}  // namespace nodal::registration
