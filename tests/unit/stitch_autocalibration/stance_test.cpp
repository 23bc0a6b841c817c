// Up from how heads stand and are held.
#include "stitch/autocalibration/stance.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "protocol/base/angles.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Vector3d;

const Vector3d kUp(0, -1, 0);

/// A head of a level rig: yaw to the right, pitch up, roll clockwise, degrees.
HeldHead looking(double yaw_deg, double pitch_deg, double roll_deg) {
  const double yaw = yaw_deg * kRadiansPerDegree, pitch = pitch_deg * kRadiansPerDegree;
  const Vector3d forward(std::sin(yaw) * std::cos(pitch), -std::sin(pitch), std::cos(yaw) * std::cos(pitch));
  const Vector3d level_right(std::cos(yaw), 0, -std::sin(yaw)), up = level_right.cross(forward);
  const Eigen::AngleAxisd roll(roll_deg * kRadiansPerDegree, forward);
  return {forward, roll * (up.y() < 0 ? up : Vector3d(-up))};
}

std::vector<HeldHead> turned(std::vector<HeldHead> heads, const Eigen::Quaterniond& by) {
  for (HeldHead& head : heads) head = {by * head.forward, by * head.up};
  return heads;
}

double off_deg(const Vector3d& up, const Vector3d& truth) {
  return std::atan2(up.cross(truth).norm(), up.dot(truth)) / kRadiansPerDegree;
}

const Eigen::Quaterniond kTilt(Eigen::AngleAxisd(0.7, Vector3d(0.3, 0.2, -0.9).normalized()));

TEST(RingUp, LevelRingsOfThreeToTenHeads_TheirAxisWhateverTheRolls) {
  for (int count = 3; count <= 10; ++count) {
    std::vector<HeldHead> heads;
    for (int k = 0; k < count; ++k) heads.push_back(looking(360.0 * k / count, 0, 12.0 * (k % 3 - 1)));
    const auto up = ring_up(turned(heads, kTilt), {0, 0, 1});
    ASSERT_TRUE(up) << count;
    EXPECT_LT(off_deg(*up, kTilt * kUp), 0.1) << count;
  }
}

TEST(RingUp, AHeadLooksUpAndTheOthersLookABitDown_TheAxisOfTheCone) {
  std::vector<HeldHead> heads{looking(0, 90, 0)};
  for (int k = 0; k < 5; ++k) heads.push_back(looking(72.0 * k, -20, 0));
  const auto up = ring_up(turned(heads, kTilt), {0, 0, 1});
  ASSERT_TRUE(up);
  EXPECT_LT(off_deg(*up, kTilt * kUp), 0.1);
}

TEST(RingUp, ASteepCone_IsNoRing) {
  std::vector<HeldHead> heads;
  for (int k = 0; k < 5; ++k) heads.push_back(looking(72.0 * k, 50, 0));
  for (int k = 0; k < 3; ++k) heads.push_back(looking(120.0 * k, 70, 0));
  EXPECT_FALSE(ring_up(turned(heads, kTilt), {0, 0, 1}));
}

TEST(RingUp, PicturesOnTheirSide_TheLightTellsWhichEndOfTheAxisIsUp) {
  std::vector<HeldHead> heads;
  for (int k = 0; k < 6; ++k) heads.push_back(looking(60.0 * k, 0, 90));
  EXPECT_LT(off_deg(*ring_up(heads, Vector3d(0.5, -0.4, 0)), kUp), 0.1);
  EXPECT_LT(off_deg(*ring_up(heads, Vector3d(0.5, 0.4, 0)), -kUp), 0.1);
}

TEST(RingUp, NoRingOrThreeOfThem_Nothing) {
  // One head along each axis forms three rings.
  std::vector<HeldHead> six;
  for (int k = 0; k < 4; ++k) six.push_back(looking(90.0 * k, 0, 0));
  six.push_back(looking(0, 90, 0));
  six.push_back(looking(0, -90, 0));
  EXPECT_FALSE(ring_up(six, kUp));
  EXPECT_FALSE(ring_up({looking(0, 0, 0), looking(180, 0, 0)}, kUp)) << "two heads look along one line";
  EXPECT_FALSE(ring_up({looking(-30, 0, 0), looking(0, 0, 0), looking(30, 0, 0)}, kUp)) << "a part of a ring";
  EXPECT_FALSE(ring_up({}, kUp));
}

TEST(HeldUp, TwoBackToBack_HowTheyAreHeld) {
  const auto up = held_up(turned({looking(0, 0, 1), looking(180, 0, -1)}, kTilt));
  ASSERT_TRUE(up);
  EXPECT_LT(off_deg(*up, kTilt * kUp), 1.5);
}

TEST(HeldUp, AFewPicturesFromTheHandThatLookDown_TheirRowsAreLevel) {
  const auto up = held_up({looking(-40, -20, 2), looking(0, -22, -1), looking(40, -18, -2)});
  ASSERT_TRUE(up);
  EXPECT_LT(off_deg(*up, kUp), 12) << "not the 20 degrees that they look down";
}

TEST(HeldUp, HeadsInEveryDirection_Nothing) {
  EXPECT_FALSE(held_up({looking(0, 0, 0), looking(90, 0, 90), looking(180, 0, 180), looking(270, 0, -90)}));
}

TEST(MostlyHeldUp, FourOfSixHeadsAreLevel_UpIsThatOfTheFour) {
  const std::vector<HeldHead> six{looking(0, 0, 1),   looking(90, 20, -1), looking(180, -20, 1),
                                  looking(270, 0, 0), looking(0, 90, 0),   looking(0, -90, 70)};
  EXPECT_FALSE(held_up(turned(six, kTilt)));
  const auto up = mostly_held_up(turned(six, kTilt));
  ASSERT_TRUE(up);
  EXPECT_LT(off_deg(*up, kTilt * kUp), 1.5);
}

TEST(MostlyHeldUp, AllLookUp_UpIsAtRightAnglesToAllRows) {
  std::vector<HeldHead> heads;
  for (int k = 0; k < 5; ++k) heads.push_back(looking(72.0 * k, 40, 0));
  heads.push_back(looking(10, 0, 180));
  const auto up = mostly_held_up(turned(heads, kTilt));
  ASSERT_TRUE(up);
  EXPECT_LT(off_deg(*up, kTilt * kUp), 0.1);
}

TEST(MostlyHeldUp, HalfOfThemOrNone_Nothing) {
  EXPECT_FALSE(mostly_held_up({looking(0, 0, 0), looking(90, 0, 0), looking(0, 0, 90), looking(0, 0, -90)}));
  EXPECT_FALSE(mostly_held_up({}));
}

}  // namespace
}  // namespace nodal::autocalibration
