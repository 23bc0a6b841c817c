#include "stitch/registration/descent.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace nodal::registration {
namespace {

constexpr double kFirstDamping = 1e-4, kLeastDamping = 1e-9;  // the first is the paper's
constexpr int kMostRefusals = 4;
constexpr double kLeastPivot = 1e-9;

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

Result<Descended> descend(Objective& objective, std::vector<HeadState> heads, const Sought& sought,
                          const Held& held, const DescentOptions& options) {
  const Parameters parameters(heads, sought, held);
  Result<Normal> start = objective.evaluate(heads, sought, true);
  if (!start) return fail(start.error());
  Descended best{std::move(heads), std::move(*start), 0};
  if (options.accepted) options.accepted(0, best.normal.objective(), 0);
  double damping = kFirstDamping;
  int refusals = 0;
  const auto step_from = [&](const Normal& normal, double lambda) {
    Eigen::MatrixXd H = parameters.hessian(normal, options.curvature);
    H.diagonal() *= 1 + lambda;
    const Eigen::VectorXd g = parameters.gradient(normal);
    const Eigen::VectorXd step = -solve_symmetric(H, g);
    return std::pair{step, -step.dot(g) / normal.cost};
  };
  auto [step, promised] = step_from(best.normal, damping);
  while (best.iterations < options.most_iterations && refusals < kMostRefusals && parameters.free_count() > 0) {
    const double turn = parameters.largest_turn(step);
    const bool still = sought.rotation && turn < options.turn_rad;
    std::vector<HeadState> tried = parameters.moved(best.heads, step);
    Result<Normal> there = objective.evaluate(tried, sought, true);
    ++best.iterations;
    const double next_damping = std::max(damping / 10, kLeastDamping);
    // A lens that no longer rises is a refusal like any other.
    bool better = there && there->objective() < best.normal.objective();
    auto [next_step, next_promised] = there ? step_from(*there, next_damping) : std::pair{step, promised};
    // The derivative holds the weights still, the objective does not: near the end the one's zero is not quite the
    // other's minimum. There the promise of the next step, which the derivative's zero takes to nothing, decides.
    if (there && options.curvature == Curvature::kCommon && next_promised < 0.5 * promised &&
        there->objective() < best.normal.objective() * 1.001) better = true;
    if (!better) {
      damping *= 10;
      ++refusals;
      if (still) break;
      step = step_from(best.normal, damping).first;
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
