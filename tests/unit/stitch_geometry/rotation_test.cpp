#include "stitch/geometry/rotation.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "examples.h"
#include "protocol/base/angles.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {
namespace {

/// The direction in the rig of a vector in the head's frame.
Eigen::Vector3d in_rig(const YawPitchRoll& pose, const Eigen::Vector3d& in_head) {
  return to_R_head_rig(pose).transpose() * in_head;
}

void expect_near(const Eigen::Vector3d& got, const Eigen::Vector3d& wanted) {
  EXPECT_LE((got - wanted).norm(), 1e-14) << got.transpose() << " is not " << wanted.transpose();
}

TEST(Rotation, YawIsToTheRight_PitchIsUp_RollIsClockwise) {
  const Eigen::Vector3d right(1, 0, 0), down(0, 1, 0), forward(0, 0, 1);
  expect_near(in_rig({90, 0, 0}, forward), right);
  expect_near(in_rig({0, 90, 0}, forward), -down);
  // Rolled clockwise by 90 degrees as seen from behind, the head's right side points down.
  expect_near(in_rig({0, 0, 90}, right), down);
  expect_near(in_rig({0, 0, 90}, forward), forward);
  // Yaw first, then pitch up: straight up for any yaw.
  expect_near(in_rig({57, 90, 0}, forward), -down);
}

RC_GTEST_PROP(Rotation, PeoplesAngles_ComeBack, ()) {
  const YawPitchRoll pose{between(-180, 180), between(-89.9, 89.9), between(-180, 180)};
  const Eigen::Matrix3d R = to_R_head_rig(pose);
  RC_ASSERT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() <= 1e-14);
  RC_ASSERT(std::abs(R.determinant() - 1) <= 1e-14);
  const YawPitchRoll back = to_yaw_pitch_roll(R);
  RC_ASSERT(std::abs(back.yaw - pose.yaw) <= 1e-9);
  RC_ASSERT(std::abs(back.pitch - pose.pitch) <= 1e-9);
  RC_ASSERT(std::abs(back.roll - pose.roll) <= 1e-9);
}

RC_GTEST_PROP(Rotation, StraightUpOrDown_TheRotationComesBackWithRollZero, ()) {
  const YawPitchRoll pose{between(-180, 180), *rc::gen::element(90.0, -90.0), between(-180, 180)};
  const Eigen::Matrix3d R = to_R_head_rig(pose);
  const YawPitchRoll back = to_yaw_pitch_roll(R);
  RC_ASSERT(back.roll == 0);
  RC_ASSERT((to_R_head_rig(back) - R).norm() <= 1e-9);
}

TEST(Rotation, NearestRotation_RepairsRoundingAndTellsWhatItIsNot) {
  Eigen::Matrix3d R = to_R_head_rig({10, 20, 30});
  const Eigen::Matrix3d exact = R;
  R(0, 1) += 3e-7;
  const Result<Eigen::Matrix3d> repaired = nearest_rotation(R);
  ASSERT_TRUE(repaired);
  EXPECT_LE((*repaired * repaired->transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LE((*repaired - exact).norm(), 3e-7);

  const Result<Eigen::Matrix3d> mirrored = nearest_rotation(-exact);
  ASSERT_FALSE(mirrored);
  EXPECT_NE(mirrored.error().message.find("reflection"), std::string::npos);
  const Result<Eigen::Matrix3d> scaled = nearest_rotation(1.01 * exact);
  ASSERT_FALSE(scaled);
  EXPECT_NE(scaled.error().message.find("not orthonormal"), std::string::npos);
  EXPECT_EQ(scaled.error().code, Errc::kNotARotation);
}

TEST(Rotation, AboutAnAxis_TurnsRightHanded) {
  expect_near(rotation_about({0, 0, kPi / 2}) * Eigen::Vector3d(1, 0, 0), {0, 1, 0});
  EXPECT_EQ(rotation_about({0, 0, 0}), Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

TEST(Rotation, Rows_AreTheDocumentsOrder) {
  const Eigen::Matrix3d R = matrix_of({1, 2, 3, 4, 5, 6, 7, 8, 9});
  EXPECT_EQ(R(0, 2), 3);
  EXPECT_EQ(R(2, 0), 7);
  EXPECT_EQ(rows_of(R), (std::array<double, 9>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(Ray, AnglesAreTheOnesOfSection31) {
  const Angles right_down = Ray::towards(1, std::sqrt(2.0), 1).angles();
  EXPECT_NEAR(right_down.theta, kPi / 4, 1e-15);
  EXPECT_NEAR(right_down.phi, kPi / 4, 1e-15);  // y is down, so phi grows downwards
  EXPECT_NEAR(Ray::towards(0, -3, 0).angles().phi, -kPi / 2, 1e-15);
  EXPECT_NEAR(Ray::towards(-1, 0, -1).angles().theta, -3 * kPi / 4, 1e-15);
}

RC_GTEST_PROP(Ray, AtItsOwnAngles_IsTheRay, ()) {
  const Ray ray = Ray::towards(between(-1, 1), between(-1, 1), between(0.01, 1));
  RC_ASSERT(angle_between(Ray::at(ray.angles()), ray) <= 1e-15 * 8);
}

TEST(Ray, AngleBetween_IsExactForTinyAngles) {
  EXPECT_NEAR(angle_between(Ray::towards(0, 0, 1), Ray::towards(1e-10, 0, 1)), 1e-10, 1e-24);
  EXPECT_NEAR(angle_between(Ray::towards(0, 0, 1), Ray::towards(0, 0, -1)), kPi, 1e-15);
}

}  // namespace
}  // namespace nodal::geometry
