#include "stitch/solve/normal_equations.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "stitch/solve/symmetric.h"

namespace nodal::solve {

NormalEquations::NormalEquations(int shared, int own, int views)
    : shared_(shared),
      own_(own),
      shared_block_(static_cast<std::size_t>(shared * shared), 0.0),
      cross_(static_cast<std::size_t>(own * shared * views), 0.0),
      own_blocks_(static_cast<std::size_t>(own * own * views), 0.0),
      gradient_(Eigen::VectorXd::Zero(shared + own * views)) {}

void NormalEquations::count_residual(double residual, double weight) {
  cost_ += weight * residual * residual;
  weight_ += weight;
  ++count_;
}

void NormalEquations::add(const double* by_shared, double residual, double weight) {
  double* block = shared_block_.data();
  for (int i = 0; i < shared_; ++i, block += shared_) {
    const double left = weight * by_shared[i];
    gradient_.data()[i] += left * residual;
    for (int k = 0; k < shared_; ++k) block[k] += left * by_shared[k];
  }
  count_residual(residual, weight);
}

void NormalEquations::add(std::span<const Eigen::Index> at, std::span<const double> slope, double residual,
                          double weight) {
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double left = weight * slope[i];
    gradient_[at[i]] += left * residual;
    double* row = shared_block_.data() + at[i] * shared_;
    for (std::size_t k = 0; k < at.size(); ++k) row[at[k]] += left * slope[k];
  }
  count_residual(residual, weight);
}

void NormalEquations::add(int view, const double* by_shared, const double* by_own, double residual, double weight) {
  add(by_shared, residual, weight);
  double* gradient = gradient_.data() + first_of(view);
  double* cross = cross_.data() + view * own_ * shared_;
  double* own = own_blocks_.data() + view * own_ * own_;
  for (int i = 0; i < own_; ++i, cross += shared_, own += own_) {
    const double left = weight * by_own[i];
    gradient[i] += left * residual;
    for (int k = 0; k < shared_; ++k) cross[k] += left * by_shared[k];
    for (int k = 0; k < own_; ++k) own[k] += left * by_own[k];
  }
}

void NormalEquations::add(const NormalEquations& other) {
  const auto add_all = [](std::vector<double>& to, const std::vector<double>& from) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
  };
  add_all(shared_block_, other.shared_block_);
  add_all(cross_, other.cross_);
  add_all(own_blocks_, other.own_blocks_);
  gradient_ += other.gradient_;
  cost_ += other.cost_;
  weight_ += other.weight_;
  count_ += other.count_;
}

Eigen::MatrixXd NormalEquations::matrix() const {
  using Rows = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(gradient_.size(), gradient_.size());
  H.topLeftCorner(shared_, shared_) = Rows(shared_block_.data(), shared_, shared_);
  for (int at = shared_, v = 0; at < size(); at += own_, ++v) {
    const Rows cross(cross_.data() + v * own_ * shared_, own_, shared_);
    H.block(at, 0, own_, shared_) = cross;
    H.block(0, at, shared_, own_) = cross.transpose();
    H.block(at, at, own_, own_) = Rows(own_blocks_.data() + v * own_ * own_, own_, own_);
  }
  return H;
}

Eigen::VectorXd NormalEquations::step(double damping, const std::vector<bool>& fixed) const {
  return solve_symmetric(matrix(), -gradient_, fixed, {.damping = damping});
}

double NormalEquations::promised_by(const Eigen::VectorXd& step) const {
  return cost_ > 0 ? -step.dot(gradient_) / cost_ : 0.0;
}

Eigen::MatrixXd NormalEquations::covariance(const std::vector<bool>& fixed) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(gradient_.size(), gradient_.size());
  const ScaledMatrix s = scale_to_unit_diagonal(matrix(), fixed);
  if (s.free.empty()) return out;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(s.A);
  // Directions that the data do not determine have eigenvalue 0: their variance is set large, not infinite.
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(1e-14).cwiseInverse();
  const Eigen::MatrixXd C = eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    for (Eigen::Index k = 0; k < C.cols(); ++k) {
      out(s.free[static_cast<std::size_t>(i)], s.free[static_cast<std::size_t>(k)]) = s.scale[i] * C(i, k) * s.scale[k];
    }
  }
  return out;
}

}  // namespace nodal::solve
