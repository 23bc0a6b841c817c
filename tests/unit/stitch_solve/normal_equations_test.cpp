#include "stitch/solve/normal_equations.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>

namespace nodal::solve {
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

TEST(NormalEquations, RowOfAFewUnknowns_AddsWhatTheWholeRowWould) {
  NormalEquations whole(5), few(5);
  const std::array<double, 5> row{0, 2, 0, -3, 0.5};
  whole.add(row.data(), 1.5, 0.7);
  const std::array<Eigen::Index, 3> at{4, 1, 3};
  const std::array<double, 3> slope{0.5, 2, -3};
  few.add(at, slope, 1.5, 0.7);
  EXPECT_EQ(whole.matrix(), few.matrix());
  EXPECT_EQ(whole.gradient(), few.gradient());
  EXPECT_EQ(few.matrix()(1, 3), 0.7 * 2 * -3);
  EXPECT_EQ(few.gradient()[4], 0.7 * 0.5 * 1.5);
  EXPECT_EQ(few.cost(), 0.7 * 1.5 * 1.5);
  EXPECT_EQ(few.count(), 1);
}

TEST(NormalEquations, NothingFree_HasNoCovarianceAndNoStep) {
  NormalEquations sum(1);
  const double one = 1;
  sum.add(&one, 3, 1);
  EXPECT_EQ(sum.covariance({true}).norm(), 0);
  EXPECT_EQ(sum.step(0, {true}).norm(), 0);
}

}  // namespace
}  // namespace nodal::solve
