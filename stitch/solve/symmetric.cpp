#include "stitch/solve/symmetric.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace nodal::solve {
namespace {

// Smaller eigenvalues of a unit-diagonal matrix are noise: this is some tens of units in the last place.
constexpr double kMinEigenvalue = 1e-14;

/// The multipliers >= 0 of a quadratic problem's bounds, by Hildreth's method: sweeps over the multipliers and sets
/// each so that its own bound is just met.
Eigen::VectorXd multipliers_of(const Eigen::MatrixXd& gram, const Eigen::VectorXd& crossed) {
  constexpr int kMaxSweeps = 2000;
  Eigen::VectorXd multipliers = Eigen::VectorXd::Zero(crossed.size());
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
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

ScaledMatrix scale_to_unit_diagonal(const Eigen::MatrixXd& H, const std::vector<bool>& fixed) {
  ScaledMatrix s;
  for (Eigen::Index i = 0; i < H.rows(); ++i) {
    if ((fixed.empty() || !fixed[static_cast<std::size_t>(i)]) && H(i, i) > 0) s.free.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(s.free.size());
  const auto at = [&](Eigen::Index i) { return s.free[static_cast<std::size_t>(i)]; };
  s.scale.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) s.scale[i] = 1 / std::sqrt(H(at(i), at(i)));
  s.A.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < n; ++k) s.A(i, k) = H(at(i), at(k)) * s.scale[i] * s.scale[k];
  }
  return s;
}

SymmetricSystem::SymmetricSystem(const Eigen::MatrixXd& H, const std::vector<bool>& fixed,
                                 const SymmetricOptions& options)
    : size_(H.rows()), scaled_(scale_to_unit_diagonal(H, fixed)) {
  if (scaled_.free.empty()) return;
  scaled_.A.diagonal().array() += options.damping;
  cholesky_.compute(scaled_.A);
  if (cholesky_.info() == Eigen::Success && cholesky_.vectorD().minCoeff() > options.least_pivot) return;
  // The matrix is symmetric: its eigenvalues are its singular values up to sign. Negative ones are noise and are left
  // out, too.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled_.A);
  eigenvectors_ = eigen.eigenvectors();
  inverse_eigenvalues_ = eigen.eigenvalues();
  for (double& each : inverse_eigenvalues_) each = each > std::max(options.least_pivot, kMinEigenvalue) ? 1 / each : 0;
}

Eigen::VectorXd SymmetricSystem::solve(const Eigen::VectorXd& g) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(size_);
  const Eigen::Index n = scaled_.scale.size();
  if (n == 0) return out;
  Eigen::VectorXd x(n);
  for (Eigen::Index i = 0; i < n; ++i) x[i] = scaled_.scale[i] * g[scaled_.free[static_cast<std::size_t>(i)]];
  x = eigenvectors_.size() == 0
          ? Eigen::VectorXd(cholesky_.solve(x))
          : Eigen::VectorXd(eigenvectors_ * (inverse_eigenvalues_.asDiagonal() * (eigenvectors_.transpose() * x)));
  for (Eigen::Index i = 0; i < n; ++i) out[scaled_.free[static_cast<std::size_t>(i)]] = scaled_.scale[i] * x[i];
  return out;
}

Eigen::MatrixXd SymmetricSystem::inverse() const {
  Eigen::MatrixXd columns(size_, size_);
  for (Eigen::Index k = 0; k < size_; ++k) columns.col(k) = solve(Eigen::VectorXd::Unit(size_, k));
  return columns;
}

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, const std::vector<bool>& fixed,
                                const SymmetricOptions& options) {
  return SymmetricSystem(H, fixed, options).solve(g);
}

Eigen::VectorXd solve_bounded(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, std::vector<Bound> bounds,
                              const SymmetricOptions& options) {
  const SymmetricSystem system(H, {}, options);
  const Eigen::VectorXd unbounded = system.solve(g);
  Eigen::VectorXd x = unbounded;
  Eigen::MatrixXd rows(0, x.size()), toward(x.size(), 0);  // one row or column per bound violated so far
  Eigen::VectorXd crossed(0);
  while (true) {
    constexpr double kTouched = 1e-8;
    const auto beyond = [&](const Bound& bound) { return bound.row.dot(x) - bound.room; };
    const auto worst = std::ranges::max_element(bounds, {}, beyond);
    if (worst == bounds.end() || beyond(*worst) <= kTouched) return x;
    const Eigen::Index n = rows.rows();
    rows.conservativeResize(n + 1, Eigen::NoChange);
    rows.row(n) = worst->row.transpose();
    toward.conservativeResize(Eigen::NoChange, n + 1);
    toward.col(n) = system.solve(worst->row);
    crossed.conservativeResize(n + 1);
    crossed[n] = worst->row.dot(unbounded) - worst->room;
    bounds.erase(worst);
    x = unbounded - toward * multipliers_of(rows * toward, crossed);
  }
}

}  // namespace nodal::solve
