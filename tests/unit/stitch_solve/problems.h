// Least-squares problems with known solutions, for the solver and for its peer Ceres.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <vector>

#include "stitch/solve/levenberg_marquardt.h"
#include "stitch/solve/symmetric.h"

namespace nodal::solve::problems {

/// Residuals and their Jacobian (one row per residual) at x.
struct Residuals {
  Eigen::VectorXd r;
  Eigen::MatrixXd J;
};
using Function = std::function<Residuals(const Eigen::VectorXd& x)>;

/// Solution (1, 1), start (-1.2, 1).
inline Residuals rosenbrock(const Eigen::VectorXd& x) {
  Residuals at{Eigen::VectorXd(2), Eigen::MatrixXd(2, 2)};
  at.r << 10 * (x[1] - x[0] * x[0]), 1 - x[0];
  at.J << -20 * x[0], 10, -1, 0;
  return at;
}

/// Powell's problem: solution 0, start (3, -1, 0, 1); the Jacobian is singular at the solution.
inline Residuals powell_singular(const Eigen::VectorXd& x) {
  const double a = x[1] - 2 * x[2], b = x[0] - x[3];
  Residuals at{Eigen::VectorXd(4), Eigen::MatrixXd::Zero(4, 4)};
  at.r << x[0] + 10 * x[1], std::sqrt(5.0) * (x[2] - x[3]), a * a, std::sqrt(10.0) * b * b;
  at.J.row(0) << 1, 10, 0, 0;
  at.J.row(1) << 0, 0, std::sqrt(5.0), -std::sqrt(5.0);
  at.J.row(2) << 0, 2 * a, -4 * a, 0;
  at.J.row(3) << 2 * std::sqrt(10.0) * b, 0, 0, -2 * std::sqrt(10.0) * b;
  return at;
}

/// y = x0 exp(-x1 t) + x2 at 40 times; every seventh value is an outlier.
inline Residuals decay_with_outliers(const Eigen::VectorXd& x) {
  constexpr int kCount = 40;
  Residuals at{Eigen::VectorXd(kCount), Eigen::MatrixXd(kCount, 3)};
  for (int i = 0; i < kCount; ++i) {
    const double t = 0.1 * i, e = std::exp(-x[1] * t);
    const double seen = 2 * std::exp(-1.3 * t) + 0.5 + 0.01 * std::sin(12.9 * i) + (i % 7 == 3 ? 0.8 : 0.0);
    at.r[i] = x[0] * e + x[2] - seen;
    at.J.row(i) << e, -x[0] * t * e, 1;
  }
  return at;
}

inline Evaluation evaluated(const Function& function, const Eigen::VectorXd& x, double huber) {
  const Residuals at = function(x);
  Evaluation sum{NormalEquations(static_cast<int>(x.size()))};
  for (Eigen::Index i = 0; i < at.r.size(); ++i) {
    const Eigen::VectorXd row = at.J.row(i);
    const double size = std::abs(at.r[i]);
    const bool outlier = huber > 0 && size > huber;
    sum.equations.add(row.data(), at.r[i], outlier ? huber / size : 1.0);
    sum.cost += outlier ? huber * (2 * size - huber) : size * size;
  }
  return sum;
}

inline Eigen::VectorXd sum_of(const Eigen::VectorXd& x, const Eigen::VectorXd& step) { return x + step; }

inline Descent<Eigen::VectorXd, Evaluation> solved(const Function& function, const Eigen::VectorXd& start,
                                                   const DescentOptions& options, double huber = 0) {
  return descend(
      start, [&](const Eigen::VectorXd& x) { return evaluated(function, x, huber); }, sum_of, {}, options);
}

/// The same with bounds: least <= x <= most.
class BoxProblem {
 public:
  BoxProblem(Function function, Eigen::VectorXd least, Eigen::VectorXd most)
      : function_(std::move(function)), least_(std::move(least)), most_(std::move(most)) {}
  Evaluation evaluate(const Eigen::VectorXd& x) const { return evaluated(function_, x, 0); }
  double cost(const Evaluation& at) const { return at.cost; }
  double promised(const Evaluation& at, const Eigen::VectorXd& step) const { return at.equations.promised_by(step); }
  Eigen::VectorXd moved(const Eigen::VectorXd& x, const Eigen::VectorXd& step) const { return x + step; }
  Eigen::VectorXd step(const Eigen::VectorXd& x, const Evaluation& at, double damping) const {
    std::vector<Bound> bounds;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      bounds.push_back({Eigen::VectorXd::Unit(x.size(), k), most_[k] - x[k]});
      bounds.push_back({-Eigen::VectorXd::Unit(x.size(), k), x[k] - least_[k]});
    }
    return solve_bounded(at.equations.matrix(), -at.equations.gradient(), bounds, {.damping = damping});
  }

 private:
  Function function_;
  Eigen::VectorXd least_, most_;
};

}  // namespace nodal::solve::problems
