// The pose in the metadata of a sphere that was turned.
#include "host_tool/output/turned_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "stitch/geometry/rotation.h"

namespace nodal::host {
namespace {

std::string value(const media::XmpProperties& properties, const std::string& name) {
  const auto found = std::ranges::find(properties, "GPano:" + name, &media::XmpProperty::name);
  return found == properties.end() ? "" : found->value;
}

media::XmpProperties turned(media::XmpProperties properties, double yaw, double pitch, double roll) {
  turn_pose(properties, geometry::to_R_head_rig({yaw, pitch, roll}));
  return properties;
}

TEST(TurnedPose, AYaw_IsAddedToTheHeading) {
  EXPECT_EQ(value(turned({{"GPano:PoseHeadingDegrees", "300"}}, 90, 0, 0), "PoseHeadingDegrees"), "30");
  EXPECT_EQ(value(turned({{"GPano:PoseHeadingDegrees", "+10.25"}}, -20, 0, 0), "PoseHeadingDegrees"), "350.25");
}

TEST(TurnedPose, ATiltThatIsStated_IsTakenAway) {
  const media::XmpProperties tilted{
      {"GPano:PoseHeadingDegrees", "40"}, {"GPano:PosePitchDegrees", "12"}, {"GPano:PoseRollDegrees", "0"}};
  const media::XmpProperties level = turned(tilted, 0, -12, 0);
  EXPECT_EQ(value(level, "PoseHeadingDegrees"), "40");
  EXPECT_EQ(value(level, "PosePitchDegrees"), "0");
  EXPECT_EQ(value(level, "PoseRollDegrees"), "0");
}

/// By spherical trigonometry: the new middle is `yaw` along the tilted horizon of a sphere whose middle is `pitch` up.
TEST(TurnedPose, AYawOfATiltedSphere_FollowsTheTiltedHorizon) {
  const double rad = std::acos(-1.0) / 180, pitch = 30 * rad, yaw = 50 * rad;
  const media::XmpProperties moved = turned(
      {{"GPano:PoseHeadingDegrees", "0"}, {"GPano:PosePitchDegrees", "30"}, {"GPano:PoseRollDegrees", "0"}}, 50, 0, 0);
  EXPECT_NEAR(std::stod(value(moved, "PosePitchDegrees")), std::asin(std::sin(pitch) * std::cos(yaw)) / rad, 0.001);
  EXPECT_NEAR(std::stod(value(moved, "PoseHeadingDegrees")),
              std::atan2(std::sin(yaw), std::cos(pitch) * std::cos(yaw)) / rad, 0.001);
}

TEST(TurnedPose, WhatIsNotStated_IsNotInvented) {
  EXPECT_TRUE(turned({}, 10, 20, 30).empty());
  const media::XmpProperties heading = turned({{"GPano:PoseHeadingDegrees", "5"}}, 10, 20, 30);
  EXPECT_EQ(heading.size(), 1U);
}

TEST(TurnedPose, TheFirstView_StaysRelativeToNorthAndElseFollowsThePicture) {
  const media::XmpProperty view{"GPano:InitialViewHeadingDegrees", "100"};
  EXPECT_EQ(value(turned({{"GPano:PoseHeadingDegrees", "5"}, view}, 30, 0, 0), "InitialViewHeadingDegrees"), "100");
  EXPECT_EQ(value(turned({view}, 30, 0, 0), "InitialViewHeadingDegrees"), "70");
}

}  // namespace
}  // namespace nodal::host
