// The solver against Ceres (ceres-solver.org): the same problems, the same robust norm, the same bounds.
#include <gtest/gtest.h>

#ifdef NODAL_HAS_CERES
#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#endif

#include "problems.h"

namespace nodal::solve {
namespace {

#ifdef NODAL_HAS_CERES

/// One of the residuals of a problem.
class OneResidual : public ceres::CostFunction {
 public:
  OneResidual(problems::Function function, int which, int unknowns) : function_(std::move(function)), which_(which) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(unknowns);
  }
  bool Evaluate(double const* const* x, double* residual, double** jacobian) const override {
    const int unknowns = parameter_block_sizes()[0];
    const problems::Residuals at = function_(Eigen::Map<const Eigen::VectorXd>(x[0], unknowns));
    *residual = at.r[which_];
    if (jacobian != nullptr && jacobian[0] != nullptr) {
      for (int k = 0; k < unknowns; ++k) jacobian[0][k] = at.J(which_, k);
    }
    return true;
  }

 private:
  problems::Function function_;
  int which_;
};

struct Peer {
  Eigen::VectorXd x;
  double cost;
};

Peer by_ceres(const problems::Function& function, const Eigen::VectorXd& start, double huber = 0,
              const Eigen::VectorXd& most = {}) {
  Eigen::VectorXd x = start;
  const auto unknowns = static_cast<int>(x.size());
  ceres::Problem problem;
  const auto residuals = static_cast<int>(function(x).r.size());
  for (int i = 0; i < residuals; ++i) {
    problem.AddResidualBlock(new OneResidual(function, i, unknowns), huber > 0 ? new ceres::HuberLoss(huber) : nullptr,
                             x.data());
  }
  for (int k = 0; k < most.size(); ++k) problem.SetParameterUpperBound(x.data(), k, most[k]);
  ceres::Solver::Options options;
  options.max_num_iterations = 300;
  options.function_tolerance = 1e-16;
  options.parameter_tolerance = 1e-14;
  options.gradient_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_TRUE(summary.IsSolutionUsable()) << summary.BriefReport();
  return {x, 2 * summary.final_cost};  // Ceres's cost is half the sum of squares
}

constexpr DescentOptions kExact{.most_steps = 300, .enough = 1e-15};

TEST(PeerCeres, RosenbrocksValley_SamePlace) {
  const Peer peer = by_ceres(problems::rosenbrock, Eigen::Vector2d(-1.2, 1));
  const auto own = problems::solved(problems::rosenbrock, Eigen::Vector2d(-1.2, 1), kExact);
  EXPECT_LT((own.state - peer.x).norm(), 1e-6);
}

TEST(PeerCeres, DecayWithOutliersUnderHubersNorm_SamePlaceAndCost) {
  const Eigen::Vector3d start(1, 1, 0);
  for (const double huber : {0.0, 0.3, 0.02}) {
    const Peer peer = by_ceres(problems::decay_with_outliers, start, huber);
    const auto own = problems::solved(problems::decay_with_outliers, start, kExact, huber);
    EXPECT_LT((own.state - peer.x).norm(), 1e-6) << huber;
    EXPECT_NEAR(own.at.cost, peer.cost, 1e-10 * peer.cost) << huber;
  }
}

TEST(PeerCeres, PowellsSingularFunction_NoWorse) {
  const Peer peer = by_ceres(problems::powell_singular, Eigen::Vector4d(3, -1, 0, 1));
  const auto own = problems::solved(problems::powell_singular, Eigen::Vector4d(3, -1, 0, 1), kExact);
  EXPECT_LT(peer.cost, 1e-12);
  EXPECT_LT(own.at.cost, 1e-12);
}

TEST(PeerCeres, BoundedRosenbrock_SamePlace) {
  const Eigen::Vector2d start(-1.2, 1), most(0.5, 2);
  const Peer peer = by_ceres(problems::rosenbrock, start, 0, most);
  problems::BoxProblem problem(problems::rosenbrock, Eigen::Vector2d(-2, -2), most);
  const Eigen::VectorXd from = start;
  const auto own = descend_from(from, problem.evaluate(from), problem, kExact);
  // Ceres stops slightly before the corner of valley and bound; the cost there is 0.25.
  EXPECT_LT((own.state - peer.x).norm(), 1e-2);
  EXPECT_LE(own.at.cost, peer.cost);
}

#else

TEST(PeerCeres, AllProblems_SamePlaces) {
  GTEST_SKIP() << "libceres-dev was not installed when this was built (.setup/install peers)";
}

#endif

}  // namespace
}  // namespace nodal::solve
