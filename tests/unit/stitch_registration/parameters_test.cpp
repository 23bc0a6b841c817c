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

TEST(Parameters, TwoFallOffsAreTheirOwn_TheOthersMoveWithTheMeanOfThem) {
  const std::vector<HeadState> heads = states();
  Sought light;
  light.rotation = light.gain = false;
  Held held = nothing_held();
  held.own_vignetting = {false, true, false, false, true, false};
  const Parameters parameters(heads, light, held);
  ASSERT_EQ(parameters.free_count(), 2 * 2);
  const Eigen::VectorXd step = Eigen::Vector4d(-0.1, -0.3, -0.02, 0.01);
  const std::vector<HeadState> next = parameters.moved(heads, step);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NE(next[1].vignetting[k], next[4].vignetting[k]);
    for (const std::size_t h : {0u, 2u, 3u, 5u}) {
      EXPECT_NEAR(next[h].vignetting[k], (next[1].vignetting[k] + next[4].vignetting[k]) / 2, 1e-15);
    }
  }
}

TEST(StepToMinimum, AFallOffThatWouldBrighten_StopsAtTheBestPlaceThatIsPlausibleAndTheOtherHeadGoesAllTheWay) {
  std::vector<HeadState> heads = states();
  heads.resize(2);
  Sought light;
  light.rotation = light.gain = false;
  Held held;
  held.geometry = held.light = {false, false};
  held.own_vignetting = {true, true};
  const Parameters parameters(heads, light, held);
  Normal normal(2, 2);
  normal.cost = normal.measure = 1;
  for (int h = 0; h < 2; ++h) {  // two elongated, rotated bowls
    double* const block = normal.block(h, h);
    block[0] = 3;
    block[1] = block[2] = 1;
    block[3] = 2;
  }
  const Eigen::Matrix2d bowl = normal.hessian(0, 0, Curvature::kOwn);
  const Eigen::Vector4d goal(0.3, 0.2, -0.2, -0.05);
  Eigen::Map<Eigen::Vector2d>(normal.gradient.data()) = -bowl * goal.head<2>();
  Eigen::Map<Eigen::Vector2d>(normal.gradient.data() + 2) = -bowl * goal.tail<2>();
  const Eigen::VectorXd step =
      parameters.basis() *
      step_to_minimum(parameters, heads, parameters.hessian(normal, Curvature::kOwn), parameters.gradient(normal), 0);
  // The minimum over a fine grid of plausible fall-offs, tested one by one.
  double best = 1e9;
  for (double a = -0.3; a < 0.3; a += 0.001) {
    for (double b = -0.5; b < 0.5; b += 0.001) {
      const Eigen::Vector2d off = Eigen::Vector2d(a, b) - goal.head<2>();
      if (plausible_fall_off({a, b, 0})) best = std::min(best, off.dot(bowl * off));
    }
  }
  const Eigen::Vector2d off = step.head<2>() - goal.head<2>();
  EXPECT_TRUE(plausible_fall_off({step[0], step[1], 0})) << step.transpose();
  EXPECT_LE(off.dot(bowl * off), best + 1e-9);
  EXPECT_NEAR(step[2], goal[2], 1e-12);
  EXPECT_NEAR(step[3], goal[3], 1e-12);
}

TEST(Parameters, AHeadIsHeld_NothingOfItsGeometryMovesButItsGainDoes) {
  const std::vector<HeadState> heads = states();
  Sought lens;
  lens.focal = lens.lens = true;
  Held held = nothing_held();
  held.geometry[3] = true;
  const Parameters parameters(heads, lens, held);
  const std::vector<HeadState> next = parameters.moved(heads, Eigen::VectorXd::Constant(parameters.free_count(), 0.01));
  EXPECT_EQ(next[3].q_head_rig.coeffs(), heads[3].q_head_rig.coeffs());
  EXPECT_EQ(next[3].lens, heads[3].lens);
  EXPECT_EQ(next[3].center_x, heads[3].center_x);
  EXPECT_NE(next[3].log_gain[0], heads[3].log_gain[0]);
  EXPECT_NE(next[4].lens, heads[4].lens);
}

}  // namespace
}  // namespace nodal::registration
