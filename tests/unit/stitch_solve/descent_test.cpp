// Levenberg-Marquardt on problems with known solutions, and at the limits of its input.
#include "stitch/solve/levenberg_marquardt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "problems.h"

namespace nodal::solve {
namespace {

using problems::solved;

constexpr DescentOptions kExact{.most_steps = 200, .enough = 1e-15};

TEST(Descend, RosenbrocksValley_EndsAtItsFloor) {
  const auto end = solved(problems::rosenbrock, Eigen::Vector2d(-1.2, 1), kExact);
  EXPECT_NEAR(end.state[0], 1, 1e-7);
  EXPECT_NEAR(end.state[1], 1, 1e-7);
  EXPECT_LT(end.at.cost, 1e-15);
  EXPECT_TRUE(end.settled);
  EXPECT_LT(end.tried, 60);  // published runs from this start take twenty to thirty
}

TEST(Descend, PowellsSingularFunction_GoesToItsDegenerateMinimum) {
  const auto end = solved(problems::powell_singular, Eigen::Vector4d(3, -1, 0, 1), kExact);
  // Convergence is linear where the Jacobian is singular: the cost falls with the fourth power of the distance.
  EXPECT_LT(end.state.norm(), 1e-3);
  EXPECT_LT(end.at.cost, 1e-12);
  EXPECT_TRUE(end.state.allFinite());
}

TEST(Descend, RankDeficientProblem_SolvesWhatIsDetermined) {
  // Only x0 + x1 = 3 is determined. The step is the shortest, so the difference stays the same.
  const auto sum_only = [](const Eigen::VectorXd& x) {
    problems::Residuals at{Eigen::VectorXd(2), Eigen::MatrixXd(2, 2)};
    at.r << x[0] + x[1] - 3, 2 * (x[0] + x[1] - 3);
    at.J << 1, 1, 2, 2;
    return at;
  };
  const auto end = solved(sum_only, Eigen::Vector2d(5, 1), kExact);
  EXPECT_NEAR(end.state.sum(), 3, 1e-9);
  EXPECT_NEAR(end.state[0] - end.state[1], 4, 1e-6);
}

TEST(Descend, StepsThatLeadToNoNumber_AreRefused) {
  // The root's argument is negative for x > 2; the minimum is exactly at that limit.
  const auto root = [](const Eigen::VectorXd& x) {
    problems::Residuals at{Eigen::VectorXd(1), Eigen::MatrixXd(1, 1)};
    at.r << std::sqrt(2 - x[0]);
    at.J << -0.5 / std::sqrt(2 - x[0]);
    return at;
  };
  const auto end = solved(root, Eigen::VectorXd::Constant(1, -3.0), kExact);
  EXPECT_TRUE(std::isfinite(end.at.cost));
  EXPECT_LT(end.at.cost, 5);  // the start's cost
  EXPECT_LE(end.state[0], 2);
  EXPECT_GT(end.tried, end.steps);  // some steps were refused: the first leads to x = 7
}

TEST(Descend, StartThatIsNoNumber_IsGivenBackUnsettled) {
  int evaluations = 0;
  const auto nothing = [&](const Eigen::VectorXd& x) {
    ++evaluations;
    return problems::Residuals{Eigen::VectorXd::Constant(1, std::numeric_limits<double>::quiet_NaN()),
                               Eigen::MatrixXd::Ones(1, x.size())};
  };
  const auto end = solved(nothing, Eigen::Vector2d(4, 5), kExact);
  EXPECT_FALSE(end.settled);
  EXPECT_EQ(end.state, Eigen::Vector2d(4, 5));
  EXPECT_EQ(evaluations, 1);
}

TEST(Descend, NoParameters_IsSettledAtOnce) {
  const auto end = solved(
      [](const Eigen::VectorXd&) {
        return problems::Residuals{Eigen::VectorXd::Ones(1), Eigen::MatrixXd(1, 0)};
      },
      Eigen::VectorXd(0), {.enough = 0});
  EXPECT_TRUE(end.settled);
  EXPECT_EQ(end.tried, 0);
  EXPECT_EQ(end.at.cost, 1);
}

TEST(Descend, BoundedRosenbrock_EndsWhereTheBoundsLetIt) {
  // With x0 <= 0.5 the valley's minimum is at (0.5, 0.25): the residual 1 - x0 is 0.5 there.
  problems::BoxProblem problem(problems::rosenbrock, Eigen::Vector2d(-2, -2), Eigen::Vector2d(0.5, 2));
  const Eigen::VectorXd start = Eigen::Vector2d(-1.2, 1);
  const auto end = descend_from(start, problem.evaluate(start), problem, kExact);
  EXPECT_NEAR(end.state[0], 0.5, 1e-7);
  EXPECT_NEAR(end.state[1], 0.25, 1e-7);
  EXPECT_NEAR(end.at.cost, 0.25, 1e-6);
  EXPECT_LE(end.state[0], 0.5 + 1e-7);
}

TEST(Descend, Outliers_PullLittleUnderHubersNorm) {
  const Eigen::Vector3d truth(2, 1.3, 0.5), start(1, 1, 0);
  const auto squares = solved(problems::decay_with_outliers, start, kExact);
  const auto robust = solved(problems::decay_with_outliers, start, kExact, 0.02);
  EXPECT_GT((squares.state - truth).norm(), 0.1);
  EXPECT_LT((robust.state - truth).norm(), 0.02);
}

TEST(DescendReweighted, WeightsThatFollowTheState_EndWhereTheirOwnEquationsHold) {
  // Weights 1 / |r| make least squares minimize the sum of distances; on a line that is the median.
  const std::vector<double> seen{1, 2, 3, 50, 70};
  std::vector<double> weights;
  const auto end = descend_reweighted(
      20.0,
      [&](const double& x) {
        Evaluation e{NormalEquations(1)};
        const double one = 1;
        for (std::size_t i = 0; i < seen.size(); ++i) e.equations.add(&one, x - seen[i], weights[i]);
        e.cost = e.equations.cost();
        return e;
      },
      [](const double& x, const Eigen::VectorXd& step) { return x + step[0]; },
      [&](const double& x) {
        weights.clear();
        for (const double at : seen) weights.push_back(1 / std::max(std::abs(x - at), 1e-6));
      },
      {.most_steps = 200, .enough = 1e-16, .first_damping = 1e-9});
  EXPECT_NEAR(end.state, 3, 1e-4);
}

TEST(Descend, WhereNoStepPromisesAnything_IsSettledWithoutAnotherEvaluation) {
  int evaluations = 0;
  const auto evaluate = [&](const double& x) {
    ++evaluations;
    Evaluation e{NormalEquations(1)};
    const double one = 1;
    for (const double at : {-1.0, 1.0}) e.equations.add(&one, x - at, 1);  // minimum at 0
    e.cost = (x + 1) * (x + 1) + (x - 1) * (x - 1);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {}, {});
  EXPECT_TRUE(end.settled);
  EXPECT_EQ(evaluations, 1);
}

TEST(Descend, StepThatPromisesLessThanIsSure_IsTakenWithoutAnotherEvaluation) {
  int evaluations = 0;
  const auto evaluate = [&](const double& x) {
    ++evaluations;
    Evaluation e{NormalEquations(1)};
    const double one = 1;
    for (const double at : {-1.0, 1.2}) e.equations.add(&one, x - at, 1);  // minimum at 0.1, lower by a hundredth
    e.cost = (x + 1) * (x + 1) + (x - 1.2) * (x - 1.2);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {}, {.sure = 0.05});
  EXPECT_TRUE(end.settled);
  EXPECT_NEAR(end.state, 0.1, 1e-4);
  EXPECT_EQ(evaluations, 1);
}

TEST(Descend, CostThatOnlyRises_KeepsTheStart) {
  const auto evaluate = [](const double& x) {
    Evaluation e{NormalEquations(1)};
    const double one = 1;
    e.equations.add(&one, 1, 1);  // a wrong slope
    e.cost = 1 + std::abs(x);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {}, {});
  EXPECT_EQ(end.state, 0.0);
  EXPECT_EQ(end.steps, 0);
}

}  // namespace
}  // namespace nodal::solve
