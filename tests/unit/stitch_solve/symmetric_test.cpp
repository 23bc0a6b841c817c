#include "stitch/solve/symmetric.h"

#include <gtest/gtest.h>

namespace nodal::solve {
namespace {

TEST(SolveSymmetric, SingularSystem_GivesTheLeastSolution) {
  // x + y = 2, twice: of all solutions (1, 1) is the shortest.
  Eigen::Matrix2d H;
  H << 1, 1, 1, 1;
  const Eigen::VectorXd x = solve_symmetric(H, Eigen::Vector2d(2, 2), {}, {.least_pivot = 1e-9});
  EXPECT_NEAR(x[0], 1, 1e-12);
  EXPECT_NEAR(x[1], 1, 1e-12);
}

TEST(SolveSymmetric, NumbersOfVeryDifferentSize_AreSolvedExactly) {
  Eigen::Matrix3d H;
  H << 1e12, 1e5, 0, 1e5, 1, 1e-7, 0, 1e-7, 1e-8;
  const Eigen::Vector3d want(1e-6, 3, 2e4);
  const Eigen::VectorXd x = solve_symmetric(H, H * want, {}, {});
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k] / want[k], 1, 1e-6);
}

TEST(SolveSymmetric, Damping_IsAShareOfEachDiagonalElement) {
  // (1 + 0.5) h x = g, element by element, whatever the size of h.
  const Eigen::Vector3d h(1e-6, 2, 3e8);
  const Eigen::VectorXd x =
      solve_symmetric(Eigen::MatrixXd(h.asDiagonal()), Eigen::Vector3d(1e-6, 2, 3e8), {}, {.damping = 0.5});
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k], 1 / 1.5, 1e-14);
}

TEST(SolveSymmetric, FixedAndUnseenUnknowns_StayZeroAndDoNotDisturbTheOthers) {
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  H.topLeftCorner<3, 3>() << 4, 1, 2, 1, 3, 5, 2, 5, 6;  // indefinite with row 2, but not without it
  const Eigen::VectorXd x = solve_symmetric(H, Eigen::Vector4d(6, 7, 8, 9), {false, false, true, false}, {});
  EXPECT_NEAR(4 * x[0] + x[1], 6, 1e-12);
  EXPECT_NEAR(x[0] + 3 * x[1], 7, 1e-12);
  EXPECT_EQ(x[2], 0);
  EXPECT_EQ(x[3], 0);
}

TEST(SolveSymmetric, NothingToSolve_IsNothing) {
  EXPECT_EQ(solve_symmetric(Eigen::MatrixXd(0, 0), Eigen::VectorXd(0), {}, {}).size(), 0);
  EXPECT_EQ(solve_symmetric(Eigen::MatrixXd::Zero(2, 2), Eigen::Vector2d(1, 1), {}, {}).norm(), 0);
}

TEST(SolveBounded, BowlWithACorner_EndsInTheCornerWhereBothBoundsPull) {
  // |x - (3, 2)|^2 / 2 with x0 <= 1, x1 <= 1.5: a box limits each coordinate separately.
  const std::vector<Bound> box{{Eigen::Vector2d(1, 0), 1}, {Eigen::Vector2d(0, 1), 1.5}};
  const Eigen::VectorXd x = solve_bounded(Eigen::Matrix2d::Identity(), Eigen::Vector2d(3, 2), box, {});
  EXPECT_NEAR(x[0], 1, 1e-9);
  EXPECT_NEAR(x[1], 1.5, 1e-9);
}

TEST(SolveBounded, BoundThatIsNotMet_ChangesNothing) {
  const std::vector<Bound> far{{Eigen::Vector2d(1, 1), 100}};
  Eigen::Matrix2d H;
  H << 3, 1, 1, 2;
  EXPECT_EQ(solve_bounded(H, Eigen::Vector2d(1, 2), far, {}), solve_symmetric(H, Eigen::Vector2d(1, 2), {}, {}));
}

TEST(SolveBounded, SlantedBound_MeetsTheConditionsOfAMinimum) {
  // Karush-Kuhn-Tucker: on the bound, the remaining gradient is a positive multiple of the bound's row.
  Eigen::Matrix2d H;
  H << 3, 1, 1, 2;
  const Eigen::Vector2d g(5, 4), row(1, 2);
  const Eigen::VectorXd x = solve_bounded(H, g, {{row, 2}}, {});
  EXPECT_NEAR(row.dot(x), 2, 1e-8);
  const Eigen::Vector2d left = g - H * x;
  EXPECT_NEAR(left[0] * row[1] - left[1] * row[0], 0, 1e-7);
  EXPECT_GT(left.dot(row), 0);
}

}  // namespace
}  // namespace nodal::solve
