// Symmetric linear systems whose unknowns differ in unit and size, and quadratic problems with linear bounds.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nodal::solve {

/// How a symmetric system is solved.
struct SymmetricOptions {
  double damping = 0;      ///< Marquardt's: this share of each diagonal element is added to it
  double least_pivot = 0;  ///< a smaller pivot of the matrix, scaled to a unit diagonal, is rounding noise
};

/// The rows and columns of a matrix that take part, scaled so that the diagonal is one.
struct ScaledMatrix {
  std::vector<Eigen::Index> free;  ///< row of the given matrix
  Eigen::VectorXd scale;           ///< given = scaled / (scale[i] scale[k])
  Eigen::MatrixXd A;
};
/// Leaves out what `fixed` marks (empty: nothing) and rows whose diagonal is not positive.
ScaledMatrix scale_to_unit_diagonal(const Eigen::MatrixXd& H, const std::vector<bool>& fixed);

/// x with H x = g, by Cholesky; where a pivot is too small, the least-norm solution (§4.4). An unknown that is fixed, or
/// whose diagonal is not positive, is 0.
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, const std::vector<bool>& fixed,
                                const SymmetricOptions& options);

/// row . x <= room, room >= 0.
struct Bound {
  Eigen::VectorXd row;
  double room = 0;
};

/// The x that minimizes x' H x / 2 - g . x among those that keep every bound.
Eigen::VectorXd solve_bounded(const Eigen::MatrixXd& H, const Eigen::VectorXd& g, std::vector<Bound> bounds,
                              const SymmetricOptions& options);

}  // namespace nodal::solve
