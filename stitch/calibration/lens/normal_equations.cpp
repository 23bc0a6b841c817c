#include "stitch/calibration/lens/normal_equations.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace nodal::calibration {
namespace {

/// The unknowns that move, and by how much each is scaled so that the matrix has ones on its diagonal.
struct Scaled {
  std::vector<Eigen::Index> free;
  Eigen::VectorXd scale;
  Eigen::MatrixXd A;
  Eigen::Index at(Eigen::Index i) const { return free[static_cast<std::size_t>(i)]; }
};

Scaled scaled(const Eigen::MatrixXd& H, const std::vector<bool>& fixed) {
  Scaled s;
  for (Eigen::Index i = 0; i < H.rows(); ++i) {
    if (!fixed[static_cast<std::size_t>(i)] && H(i, i) > 0) s.free.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(s.free.size());
  s.scale.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) s.scale[i] = 1 / std::sqrt(H(s.at(i), s.at(i)));
  s.A.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < n; ++k) s.A(i, k) = H(s.at(i), s.at(k)) * s.scale[i] * s.scale[k];
  }
  return s;
}

}  // namespace

NormalEquations::NormalEquations(int shared, int own, int views)
    : shared_(shared),
      own_(own),
      shared_block_(static_cast<std::size_t>(shared * shared), 0.0),
      cross_(static_cast<std::size_t>(own * shared * views), 0.0),
      own_blocks_(static_cast<std::size_t>(own * own * views), 0.0),
      gradient_(Eigen::VectorXd::Zero(shared + own * views)) {}

void NormalEquations::add(int view, const double* by_shared, const double* by_own, double residual, double weight) {
  double* gradient = gradient_.data();
  double* block = shared_block_.data();
  for (int i = 0; i < shared_; ++i, block += shared_) {
    const double left = weight * by_shared[i];
    gradient[i] += left * residual;
    for (int k = 0; k < shared_; ++k) block[k] += left * by_shared[k];
  }
  gradient += first_of(view);
  double* cross = cross_.data() + view * own_ * shared_;
  double* own = own_blocks_.data() + view * own_ * own_;
  for (int i = 0; i < own_; ++i, cross += shared_, own += own_) {
    const double left = weight * by_own[i];
    gradient[i] += left * residual;
    for (int k = 0; k < shared_; ++k) cross[k] += left * by_shared[k];
    for (int k = 0; k < own_; ++k) own[k] += left * by_own[k];
  }
  cost_ += weight * residual * residual;
  weight_ += weight;
  ++count_;
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

Eigen::MatrixXd NormalEquations::full() const {
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
  Scaled s = scaled(full(), fixed);
  s.A.diagonal().array() += damping;
  Eigen::VectorXd g(s.scale.size());
  for (Eigen::Index i = 0; i < g.size(); ++i) g[i] = -s.scale[i] * gradient_[s.at(i)];
  const Eigen::VectorXd x = s.A.ldlt().solve(g);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(gradient_.size());
  for (Eigen::Index i = 0; i < g.size(); ++i) out[s.at(i)] = s.scale[i] * x[i];
  return out;
}

double NormalEquations::promised_by(const Eigen::VectorXd& step) const {
  return cost_ > 0 ? -step.dot(gradient_) / cost_ : 0.0;
}

Eigen::MatrixXd NormalEquations::covariance(const std::vector<bool>& fixed) const {
  const Scaled s = scaled(full(), fixed);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(s.A);
  // What the data cannot tell is a direction of eigenvalue 0: its variance is large, not infinite.
  const Eigen::VectorXd inverse = eigen.eigenvalues().cwiseMax(1e-14).cwiseInverse();
  const Eigen::MatrixXd C = eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(gradient_.size(), gradient_.size());
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    for (Eigen::Index k = 0; k < C.cols(); ++k) out(s.at(i), s.at(k)) = s.scale[i] * C(i, k) * s.scale[k];
  }
  return out;
}

}  // namespace nodal::calibration
