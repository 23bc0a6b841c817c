#include "stitch/calibration/lens/normal_equations.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "stitch/calibration/lens/levenberg_marquardt.h"

namespace nodal::calibration {
namespace {

TEST(NormalEquations, StraightLineWithAnOffsetPerView_IsSolvedInOneStep) {
  // y = 3 x + offset[view], from zero: residual = model - y = 0 - y.
  NormalEquations sum(1, 1, 2);
  const std::array<double, 2> offset{-1, 5};
  for (int view = 0; view < 2; ++view) {
    for (const double x : {0.0, 1.0, 2.0, 4.0}) {
      const double by_own = 1;
      sum.add(view, &x, &by_own, -(3 * x + offset[static_cast<std::size_t>(view)]), 1);
    }
  }
  const Eigen::VectorXd step = sum.step(0, {false, false, false});
  EXPECT_NEAR(step[0], 3, 1e-12);
  EXPECT_NEAR(step[1], -1, 1e-12);
  EXPECT_NEAR(step[2], 5, 1e-12);
  EXPECT_EQ(sum.count(), 8);
}

TEST(NormalEquations, WhatIsFixedOrSeenByNothing_DoesNotMove) {
  NormalEquations sum(2, 1, 1);
  const std::array<double, 2> by_shared{1, 0};
  const double by_own = 1;
  sum.add(0, by_shared.data(), &by_own, -2, 1);
  const Eigen::VectorXd step = sum.step(1e-9, {false, false, true});
  EXPECT_NEAR(step[0], 2, 1e-6);
  EXPECT_EQ(step[1], 0);
  EXPECT_EQ(step[2], 0);
}

TEST(NormalEquations, Covariance_IsTheInverseOfTheWeightedSum) {
  NormalEquations sum(2, 1, 1);
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (int n = 0; n < 6; ++n) {
    const Eigen::Vector3d row(1 + n, std::sin(n), std::cos(2 * n));
    const double weight = 0.5 + n;
    sum.add(0, row.data(), row.data() + 2, 0.1, weight);
    H += weight * row * row.transpose();
  }
  const Eigen::MatrixXd covariance = sum.covariance({false, false, false});
  EXPECT_LT((covariance - H.inverse()).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Descend, RosenbrocksValley_EndsAtItsFloor) {
  struct Place {
    double x = -1.2, y = 1;
  };
  const auto evaluate = [](const Place& p) {
    Evaluation e{NormalEquations(2, 1, 1)};
    const double by_own = 0;
    const std::array<double, 2> a{-20 * p.x, 10};
    const std::array<double, 2> b{-1, 0};
    const double ra = 10 * (p.y - p.x * p.x);
    const double rb = 1 - p.x;
    e.equations.add(0, a.data(), &by_own, ra, 1);
    e.equations.add(0, b.data(), &by_own, rb, 1);
    e.cost = ra * ra + rb * rb;
    return e;
  };
  const auto moved = [](const Place& p, const Eigen::VectorXd& d) { return Place{p.x + d[0], p.y + d[1]}; };
  const auto end = descend(Place{}, evaluate, moved, {false, false, false}, {.most_steps = 100, .enough = 1e-15});
  EXPECT_NEAR(end.state.x, 1, 1e-6);
  EXPECT_NEAR(end.state.y, 1, 1e-6);
}

TEST(Descend, WhereNoStepPromisesAnything_IsSettledWithoutAnotherEvaluation) {
  int evaluations = 0;
  const auto evaluate = [&](const double& x) {
    ++evaluations;
    Evaluation e{NormalEquations(1, 1, 1)};
    const double one = 1, none = 0;
    for (const double at : {-1.0, 1.0}) e.equations.add(0, &one, &none, x - at, 1);  // lowest at 0
    e.cost = (x + 1) * (x + 1) + (x - 1) * (x - 1);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {false, false}, {});
  EXPECT_TRUE(end.settled);
  EXPECT_EQ(evaluations, 1);
}

TEST(Descend, StepThatPromisesLessThanIsSure_IsTakenWithoutAnotherEvaluation) {
  int evaluations = 0;
  const auto evaluate = [&](const double& x) {
    ++evaluations;
    Evaluation e{NormalEquations(1, 1, 1)};
    const double one = 1, none = 0;
    for (const double at : {-1.0, 1.2}) e.equations.add(0, &one, &none, x - at, 1);  // lowest at 0.1, a hundredth less
    e.cost = (x + 1) * (x + 1) + (x - 1.2) * (x - 1.2);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {false, false}, {.sure = 0.05});
  EXPECT_TRUE(end.settled);
  EXPECT_NEAR(end.state, 0.1, 1e-4);
  EXPECT_EQ(evaluations, 1);
}

TEST(Descend, CostThatOnlyRises_KeepsTheStart) {
  const auto evaluate = [](const double& x) {
    Evaluation e{NormalEquations(1, 1, 1)};
    const double one = 1, none = 0;
    e.equations.add(0, &one, &none, 1, 1);  // a slope that lies
    e.cost = 1 + std::abs(x);
    return e;
  };
  const auto moved = [](const double& x, const Eigen::VectorXd& d) { return x + d[0]; };
  const auto end = descend(0.0, evaluate, moved, {false, false}, {});
  EXPECT_EQ(end.state, 0.0);
  EXPECT_EQ(end.steps, 0);
}

}  // namespace
}  // namespace nodal::calibration
