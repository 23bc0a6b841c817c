// Symmetric linear systems whose unknowns differ in unit and size, and quadratic problems with linear bounds.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

namespace nodal::solve {

/// How a symmetric system is solved.
struct SymmetricOptions {
  double damping = 0;      ///< Marquardt's damping: the share of each diagonal element that is added to it
  double least_pivot = 0;  ///< smallest pivot of the matrix scaled to a unit diagonal; a smaller one is rounding noise
};

/// The submatrix of the unknowns that are solved for, scaled to a unit diagonal.
struct ScaledMatrix {
  std::vector<Eigen::Index> free;  ///< their row in the given matrix
  Eigen::VectorXd scale;           ///< given = scaled / (scale[i] scale[k])
  Eigen::MatrixXd A;
};
/// Leaves out the rows that `fixed` marks (empty: none) and those whose diagonal is not positive.
ScaledMatrix scale_to_unit_diagonal(const Eigen::MatrixXd& H, const std::vector<bool>& fixed);

/// H x = g for several g. By Cholesky; where a pivot is too small, the least-norm solution (§4.4). An unknown that is
/// fixed, or whose diagonal is not positive, is 0.
///
/// Threading: immutable.
class SymmetricSystem {
 public:
  SymmetricSystem(const Eigen::MatrixXd& H, const std::vector<bool>& fixed, const SymmetricOptions& options);
  Eigen::VectorXd solve(const Eigen::VectorXd& g) const;
  /// The inverse of H, symmetric but for rounding.
  Eigen::MatrixXd inverse() const;

 private:
  Eigen::Index size_;
  ScaledMatrix scaled_;
  Eigen::LDLT<Eigen::MatrixXd> cholesky_;
  Eigen::MatrixXd eigenvectors_;         // empty: Cholesky's factors are used
  Eigen::VectorXd inverse_eigenvalues_;  // 0 for those that are noise
};

/// Solves H x = g for one g.
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, const std::vector<bool>& fixed,
                                const SymmetricOptions& options);

/// The constraint row . x <= room, room >= 0.
struct Bound {
  Eigen::VectorXd row;
  double room = 0;
};

/// The x that minimizes x' H x / 2 - g . x under all bounds.
Eigen::VectorXd solve_bounded(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, std::vector<Bound> bounds,
                              const SymmetricOptions& options);

}  // namespace nodal::solve
