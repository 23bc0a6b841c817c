// The angle between successive pictures, of a rendered town that is turned by known angles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/geometry/rotation.h"
#include "stitch/motion/head_motion.h"
#include "tests/support/rendered_rig.h"

namespace nodal::motion {
namespace {

constexpr double kPerDegree = std::numbers::pi / 180;
constexpr int kSide = 160;

/// The town as the first of six fisheyes sees it after a rotation of the rig, rad.
std::vector<std::uint8_t> seen_after(const Eigen::Vector3d& rotation, double noise = 1, std::uint64_t seed = 1) {
  Calibration rig = test::six_fisheyes(kSide);
  rig.heads.resize(1);
  HeadCalibration& head = rig.heads[0];
  head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * geometry::rotation_about(rotation));
  return test::render_rig(rig, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, noise, seed, 3}).bytes[0];
}

HeadMotion motion_of_head() {
  auto motion = HeadMotion::make(test::six_fisheyes(kSide).heads[0], kSide, kSide);
  EXPECT_TRUE(motion) << motion.error().text();
  return std::move(*motion);
}

TEST(HeadMotion, RigThatTurns_TheAngleIsTrue) {
  const std::vector<Eigen::Vector3d> axes{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, -0.48, 0.64}};
  for (const Eigen::Vector3d& axis : axes) {
    for (const double degrees : {0.1, 0.5, 2.0, 5.0}) {
      HeadMotion motion = motion_of_head();
      EXPECT_FALSE(motion.add(seen_after({0, 0, 0})));
      const auto angle = motion.add(seen_after(degrees * kPerDegree * axis, 1, 2));
      ASSERT_TRUE(angle) << degrees << " about " << axis.transpose();
      EXPECT_NEAR(*angle / kPerDegree, degrees, 0.02 + 0.02 * degrees) << axis.transpose();
    }
  }
}

TEST(HeadMotion, ExposureThatChanges_TheAngleIsTrue) {
  HeadMotion motion = motion_of_head();
  motion.add(seen_after({0, 0, 0}));
  auto darker = seen_after({0, 1 * kPerDegree, 0}, 1, 2);
  for (std::uint8_t& level : darker) level = static_cast<std::uint8_t>(0.7 * level + 10);
  const auto angle = motion.add(darker);
  ASSERT_TRUE(angle);
  EXPECT_NEAR(*angle / kPerDegree, 1, 0.03);
}

TEST(HeadMotion, StillRig_IsNearlyStill) {
  HeadMotion motion = motion_of_head();
  motion.add(seen_after({0, 0, 0}, 2, 1));
  const auto angle = motion.add(seen_after({0, 0, 0}, 2, 2));
  ASSERT_TRUE(angle);
  EXPECT_LT(*angle / kPerDegree, 0.02);
}

TEST(HeadMotion, NothingToSeeOrAnotherPlace_NoAngle) {
  HeadMotion blank = motion_of_head();
  const std::vector<std::uint8_t> grey(kSide * kSide, 100);
  blank.add(grey);
  EXPECT_FALSE(blank.add(grey));
  HeadMotion motion = motion_of_head();
  motion.add(seen_after({0, 0, 0}));
  EXPECT_FALSE(motion.add(seen_after({0, 2.5, 0}))) << "a cut to another place";
  EXPECT_FALSE(motion.add(std::vector<std::uint8_t>(10))) << "a picture of another size";
}

TEST(HeadMotion, PicturesThatAreTooSmall_AreRefused) {
  EXPECT_FALSE(HeadMotion::make(test::six_fisheyes(kSide).heads[0], 8, 8));
  EXPECT_FALSE(HeadMotion::make(test::six_fisheyes(kSide).heads[0], 2 * kSide, 2 * kSide));
}

}  // namespace
}  // namespace nodal::motion
