#include "stitch/registration/parameters.h"

#include <gtest/gtest.h>

#include "stitch/registration/descent.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

std::vector<HeadState> states() {
  std::vector<HeadState> all;
  for (const HeadCalibration& head : test::six_fisheyes(100).heads) all.push_back(*HeadState::from(head));
  return all;
}

Held nothing_held() {
  Held held;
  held.geometry.assign(6, false);
  held.light.assign(6, false);
  return held;
}

TEST(Parameters, AnyStep_LeavesTheFirstHeadsRotationAndTheSumOfLogGains) {
  const std::vector<HeadState> heads = states();
  const Parameters parameters(heads, Sought{}, nothing_held());
  // 5 rotations, 5 gains, a shared fall-off of two terms.
  ASSERT_EQ(parameters.free_count(), 15 + 5 + 2);
  const Eigen::VectorXd step = Eigen::VectorXd::LinSpaced(parameters.free_count(), -0.03, 0.05);
  const std::vector<HeadState> next = parameters.moved(heads, step);
  EXPECT_EQ(next[0].q_head_rig.coeffs(), heads[0].q_head_rig.coeffs());
  double sum = 0;
  for (const HeadState& head : next) sum += head.log_gain[0];
  EXPECT_NEAR(sum, 0, 1e-15);
  for (const HeadState& head : next) {
    EXPECT_EQ(head.vignetting, next[0].vignetting);
    EXPECT_NEAR(head.q_head_rig.norm(), 1, 1e-15);
  }
}

TEST(Parameters, AHeadIsHeld_NothingOfItsGeometryMovesButItsGainDoes) {
  const std::vector<HeadState> heads = states();
  Sought lens;
  lens.focal = lens.lens = true;
  Held held = nothing_held();
  held.geometry[3] = true;
  const Parameters parameters(heads, lens, held);
  const std::vector<HeadState> next =
      parameters.moved(heads, Eigen::VectorXd::Constant(parameters.free_count(), 0.01));
  EXPECT_EQ(next[3].q_head_rig.coeffs(), heads[3].q_head_rig.coeffs());
  EXPECT_EQ(next[3].lens, heads[3].lens);
  EXPECT_EQ(next[3].center_x, heads[3].center_x);
  EXPECT_NE(next[3].log_gain[0], heads[3].log_gain[0]);
  EXPECT_NE(next[4].lens, heads[4].lens);
}

TEST(SolveSymmetric, SingularSystem_GivesTheLeastSolution) {
  // x + y = 2 twice over: of all solutions (1, 1) is the shortest.
  Eigen::Matrix2d H;
  H << 1, 1, 1, 1;
  const Eigen::VectorXd x = solve_symmetric(H, Eigen::Vector2d(2, 2));
  EXPECT_NEAR(x[0], 1, 1e-12);
  EXPECT_NEAR(x[1], 1, 1e-12);
}

TEST(SolveSymmetric, NumbersOfVeryDifferentSize_AreSolvedExactly) {
  Eigen::Matrix3d H;
  H << 1e12, 1e5, 0, 1e5, 1, 1e-7, 0, 1e-7, 1e-8;
  const Eigen::Vector3d want(1e-6, 3, 2e4);
  const Eigen::VectorXd x = solve_symmetric(H, H * want);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(x[k] / want[k], 1, 1e-6);
}

}  // namespace
}  // namespace nodal::registration
