#include "stitch/view/camera_path.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <string>

namespace nodal::view {
namespace {

CameraPath path(const std::string& text) { return CameraPath::parse(text).value(); }

TEST(CameraPath, PassesItsKeysAndRestsBesideThem) {
  const CameraPath of =
      path("picture,yaw,pitch,roll,fov\n10,-30,5,0,90\n 20, 60, -5, 10, 45 # closer\n\n50,700,0,0,120\r\n");
  for (const CameraKey& key : of.keys()) {
    EXPECT_EQ(of.at(key.picture).pose.yaw, key.pose.yaw);
    EXPECT_EQ(of.at(key.picture).pose.pitch, key.pose.pitch);
    EXPECT_EQ(of.at(key.picture).pose.roll, key.pose.roll);
    EXPECT_EQ(of.at(key.picture).fov_deg, key.fov_deg);
  }
  EXPECT_EQ(of.at(0).pose.yaw, -30);
  EXPECT_EQ(of.at(1000).fov_deg, 120);
}

TEST(CameraPath, OfEquallySpacedKeysOnALine_IsThatLineBetweenTheInnerOnes) {
  const CameraPath of = path("0,0,0,0,90\n10,20,0,0,90\n20,40,0,0,90\n30,60,0,0,90\n");
  for (int k = 10; k <= 20; ++k) EXPECT_NEAR(of.at(k).pose.yaw, 2 * k, 1e-12);
  // At the ends it starts and stops gently: from rest to slope 2, Hermite's cubic has 20 t t (3 - 2 t) - 20 t t (1 -
  // t).
  for (int k = 0; k <= 10; ++k) EXPECT_NEAR(of.at(k).pose.yaw, 20 * (2 * k * k / 100.0 - k * k * k / 1000.0), 1e-12);
}

RC_GTEST_PROP(CameraPath, NeverGoesBeyondTheKeysBesideIt_AndHasNoJumps, ()) {
  std::string text;
  std::int64_t picture = 0;
  const int keys = *rc::gen::inRange(1, 8);
  for (int k = 0; k < keys; ++k) {
    picture += *rc::gen::inRange(1, 400);
    text += std::to_string(picture) + "," + std::to_string(*rc::gen::inRange(-720, 720)) + "," +
            std::to_string(*rc::gen::inRange(-90, 91)) + ",0," + std::to_string(*rc::gen::inRange(1, 170)) + "\n";
  }
  const CameraPath of = path(text);
  for (std::size_t k = 0; k + 1 < of.keys().size(); ++k) {
    const CameraKey &from = of.keys()[k], &to = of.keys()[k + 1];
    const double most = std::abs(to.pose.yaw - from.pose.yaw) / static_cast<double>(to.picture - from.picture);
    for (std::int64_t at = from.picture; at < to.picture; ++at) {
      const double yaw = of.at(at).pose.yaw, next = of.at(at + 1).pose.yaw;
      RC_ASSERT(yaw >= std::min(from.pose.yaw, to.pose.yaw));
      RC_ASSERT(yaw <= std::max(from.pose.yaw, to.pose.yaw));
      // Monotone, and nowhere steeper than three times the mean (Fritsch and Carlson's condition).
      RC_ASSERT((next - yaw) * (to.pose.yaw - from.pose.yaw) >= -1e-9);
      RC_ASSERT(std::abs(next - yaw) <= 3 * most + 1e-9);
      RC_ASSERT(of.at(at).fov_deg >= std::min(from.fov_deg, to.fov_deg));
      RC_ASSERT(of.at(at).fov_deg <= std::max(from.fov_deg, to.fov_deg));
    }
  }
}

TEST(CameraPath, WhatIsNoPath_NamesTheLine) {
  const auto says = [](const std::string& text, const std::string& expected) {
    const Result<CameraPath> read = CameraPath::parse(text);
    ASSERT_FALSE(read) << text;
    EXPECT_NE(read.error().message.find(expected), std::string::npos) << read.error().message;
  };
  says("", "there is no key");
  says("# nothing\n\n", "there is no key");
  says("0,0,0,0,90\n10,20\n", "line 2: write picture,yaw,pitch,roll,fov");
  says("0,0,0,0,90,1\n", "line 1: write");
  says("0,east,0,0,90\n", "line 1: write");
  says("0.5,0,0,0,90\n", "line 1: write");
  says("picture,yaw,pitch,roll,fov\npicture,yaw,pitch,roll,fov\n", "line 2: write");
  says("5,0,0,0,90\n5,1,0,0,90\n", "line 2: picture 5 is not after");
  says("-1,0,0,0,90\n", "line 1: a picture is 0 to 9999999");
  says("10000000,0,0,0,90\n", "line 1: a picture is");
  says("0,1e9,0,0,90\n", "line 1: yaw and roll");
  says("0,nan,0,0,90\n", "line 1: yaw and roll");
  says("0,0,91,0,90\n", "line 1: pitch");
  says("0,0,0,0,inf\n", "line 1: the field of view");
}

}  // namespace
}  // namespace nodal::view
