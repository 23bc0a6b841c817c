// The normal equations of a least-squares problem with unknowns common to all views and unknowns of a single view.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace nodal::solve {

/// Accumulates J^T W J and J^T W r for `shared` unknowns, and for `own` unknowns of each of `views` views. A problem
/// with shared unknowns only has no views.
class NormalEquations {
 public:
  explicit NormalEquations(int shared, int own = 0, int views = 0);
  int size() const { return static_cast<int>(gradient_.size()); }
  int first_of(int view) const { return shared_ + view * own_; }

  /// Adds a residual: its derivatives with respect to the shared and to the view's own unknowns.
  void add(int view, const double* by_shared, const double* by_own, double residual, double weight);
  /// Adds a residual that depends on shared unknowns only.
  void add(const double* by_shared, double residual, double weight);
  /// Adds a residual that depends on a few shared unknowns: slope[k] is its derivative by unknown at[k]. No duplicates.
  void add(std::span<const Eigen::Index> at, std::span<const double> slope, double residual, double weight);
  void add(const NormalEquations& other);

  /// The step that lowers the cost, with Marquardt's damping. An unknown that `fixed` marks (empty: none), or that no
  /// residual depends on, does not move.
  Eigen::VectorXd step(double damping, const std::vector<bool>& fixed) const;
  /// The share of the cost that a step would remove if the residuals were linear.
  double promised_by(const Eigen::VectorXd& step) const;
  /// The inverse of J^T W J over the unknowns that are not fixed (rows and columns of the others are zero).
  Eigen::MatrixXd covariance(const std::vector<bool>& fixed) const;

  Eigen::MatrixXd matrix() const;                                ///< J^T W J
  const Eigen::VectorXd& gradient() const { return gradient_; }  ///< J^T W r
  double cost() const { return cost_; }                          ///< sum of w r^2
  double weight() const { return weight_; }                      ///< sum of w
  long count() const { return count_; }

 private:
  void count_residual(double residual, double weight);
  int shared_;
  int own_;
  // Row-major: shared x shared; then, for each view, own x shared and own x own.
  std::vector<double> shared_block_;
  std::vector<double> cross_;
  std::vector<double> own_blocks_;
  Eigen::VectorXd gradient_;
  double cost_ = 0;
  double weight_ = 0;
  long count_ = 0;
};

}  // namespace nodal::solve
