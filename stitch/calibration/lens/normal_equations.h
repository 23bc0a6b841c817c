// Least squares over numbers that all photographs share and numbers that are one photograph's own.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nodal::calibration {

/// Gathers J^T W J and J^T W r for `shared` unknowns and `own` unknowns of each of `views` photographs.
class NormalEquations {
 public:
  NormalEquations(int shared, int own, int views);
  int size() const { return static_cast<int>(gradient_.size()); }
  int first_of(int view) const { return shared_ + view * own_; }

  /// One residual: its derivatives by the shared and by the view's own unknowns.
  void add(int view, const double* by_shared, const double* by_own, double residual, double weight);
  void add(const NormalEquations& other);

  /// The step that lowers the sum, with Marquardt's damping; an unknown that `fixed` marks or that nothing
  /// depends on does not move.
  Eigen::VectorXd step(double damping, const std::vector<bool>& fixed) const;
  /// The part of the cost that a step would take away, were the residuals linear.
  double promised_by(const Eigen::VectorXd& step) const;
  /// The inverse of J^T W J over the unknowns that are not fixed (rows and columns of the others are zero).
  Eigen::MatrixXd covariance(const std::vector<bool>& fixed) const;

  double cost() const { return cost_; }      ///< sum of w r^2
  double weight() const { return weight_; }  ///< sum of w
  long count() const { return count_; }

 private:
  Eigen::MatrixXd full() const;
  int shared_;
  int own_;
  // Rows one after the other: shared x shared; then for each view own x shared and own x own.
  std::vector<double> shared_block_;
  std::vector<double> cross_;
  std::vector<double> own_blocks_;
  Eigen::VectorXd gradient_;
  double cost_ = 0;
  double weight_ = 0;
  long count_ = 0;
};

}  // namespace nodal::calibration
