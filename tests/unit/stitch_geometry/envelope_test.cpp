// Envelopes: the radial function, the kernel, and what an eye sees.
#include "stitch/geometry/envelope/envelope.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

namespace nodal::geometry {
namespace {

using Eigen::Vector3d;

Ray random_ray(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Ray::towards(normal(random), normal(random), normal(random));
}

/// A box of 4 x 2 x 6 m, its corners in the order of the bits of their numbers.
std::string box(const std::string& faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n") {
  std::string text = "# a room\no room\n";
  for (int k = 0; k < 8; ++k) {
    text += "v " + std::to_string(k & 1 ? 2 : -2) + " " + std::to_string(k & 2 ? 1 : -1) + " " +
            std::to_string(k & 4 ? 3 : -3) + "\n";
  }
  return text + faces;
}

/// Where a line from a point inside leaves the box.
Vector3d leaves_box(const Vector3d& eye, const Vector3d& d) {
  const Vector3d half(2, 1, 3);
  double nearest = 1e300;
  for (int k = 0; k < 3; ++k) {
    if (d[k] != 0) nearest = std::min(nearest, ((d[k] > 0 ? half[k] : -half[k]) - eye[k]) / d[k]);
  }
  return eye + nearest * d;
}

TEST(Envelope, Sphere_IsSeenWhereTheLineLeavesIt) {
  const Envelope sphere = Envelope::sphere(3).value();
  std::mt19937 random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const Vector3d eye = 2.9 * random_ray(random).direction();
    const Ray ray = random_ray(random);
    const Vector3d point = sphere.seen(eye, ray);
    EXPECT_NEAR(point.norm(), 3, 1e-12);
    EXPECT_LE(angle_between(Ray::towards(point - eye), ray), 1e-9);
  }
  EXPECT_TRUE(sphere.check_eye({0, 2.9, 0}));
  EXPECT_FALSE(sphere.check_eye({0, 3, 0}));
}

TEST(Envelope, Box_IsSeenWhereTheLineLeavesIt) {
  const Envelope room = Envelope::from_obj(box()).value();
  std::mt19937 random(2);
  for (const Vector3d& eye : {Vector3d(0, 0, 0), Vector3d(1.9, -0.9, 2), Vector3d(-1, 0.5, -2.9)}) {
    ASSERT_TRUE(room.check_eye(eye));
    for (int trial = 0; trial < 200; ++trial) {
      const Ray ray = random_ray(random);
      EXPECT_LE((room.seen(eye, ray) - leaves_box(eye, ray.direction())).norm(), 1e-9);
    }
  }
}

TEST(Envelope, FacesThatAllRunAroundTheOtherWay_AreTheSameEnvelope) {
  const Envelope room =
      Envelope::from_obj(box("f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n")).value();
  EXPECT_LE((room.seen(Vector3d::Zero(), Ray::towards(1, 0, 0)) - Vector3d(2, 0, 0)).norm(), 1e-12);
}

/// A room with a niche: seen from above an L, walls of height 2.  Its kernel is the square of both arms.
std::string niche() {
  std::string text;
  const double outline[6][2] = {{-1, -1}, {4, -1}, {4, 1}, {1, 1}, {1, 4}, {-1, 4}};  // x, z
  for (const double y : {-1.0, 1.0}) {
    for (const auto& at : outline)
      text += "v " + std::to_string(at[0]) + " " + std::to_string(y) + " " + std::to_string(at[1]) + "\n";
  }
  text += "f 1 2 3 4\nf 1 4 5 6\nf 10 9 8 7\nf 12 11 10 7\n";
  for (int k = 0; k < 6; ++k) {
    const int a = k + 1, b = (k + 1) % 6 + 1;
    text += "f " + std::to_string(b) + " " + std::to_string(a) + " " + std::to_string(a + 6) + " " +
            std::to_string(b + 6) + "\n";
  }
  return text;
}

TEST(Envelope, KernelOfAnLShapedRoom_IsTheSquareOfBothArms) {
  const Envelope room = Envelope::from_obj(niche()).value();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> x(-0.99, 3.9), y(-0.99, 0.99);
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3d eye(x(random), y(random), x(random));
    EXPECT_EQ(room.check_eye(eye).has_value(), eye.x() < 1 && eye.z() < 1) << eye.transpose();
  }
  const Status outside = room.check_eye({3, 0, 0});
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error().code, Errc::kBadValue);
  EXPECT_NE(outside.error().message.find("the face of line 20"), std::string::npos) << outside.error().message;
}

void expect_refused(const std::string& text, Errc code, const std::string& says) {
  const Result<Envelope> envelope = Envelope::from_obj(text);
  ASSERT_FALSE(envelope) << says;
  EXPECT_EQ(envelope.error().code, code) << says;
  EXPECT_NE(envelope.error().message.find(says), std::string::npos) << envelope.error().message;
}

TEST(Envelope, BadMeshes_AreRefusedWithTheLine) {
  expect_refused("", Errc::kBadFormat, "no face");
  expect_refused("v 1 2\n", Errc::kBadFormat, "line 1: after v there must be three numbers");
  expect_refused("v 1 2 nan\n", Errc::kBadFormat, "line 1");
  expect_refused("v 1 2 1e7\n", Errc::kBadFormat, "line 1");
  expect_refused("v 0 0 1\nf 1 1 2\n", Errc::kBadFormat, "line 2: '2' names none of the 1 vertices");
  expect_refused("v 0 0 1\nf 1 1 99999999999\n", Errc::kBadFormat, "line 2");
  expect_refused("v 0 0 1\nf 1 1\n", Errc::kBadFormat, "line 2: a face needs three");
  expect_refused(box("f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\n"), Errc::kBadValue, "a hole");
  expect_refused(box("f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"), Errc::kBadValue,
                 "folds over, or runs around the other way");
  std::string away = box();
  for (std::size_t at = away.find("v -2"); at != std::string::npos; at = away.find("v -2")) away.replace(at, 4, "v 1");
  expect_refused(away, Errc::kBadValue, "the nodal point (0, 0, 0) does not see the inner side");
  expect_refused(std::string(Envelope::kMaxObjBytes + 1, ' '), Errc::kTooLarge, "bytes");
  std::string many = "v 0 0 1\nf";
  for (std::size_t k = 0; k < Envelope::kMaxTriangles + 3; ++k) many += " 1";
  expect_refused(many + "\n", Errc::kTooLarge, "triangles");
}

TEST(Envelope, SpheresWithoutARadius_AreRefused) {
  for (const double radius : {0.0, -1.0, std::nan(""), 1e7}) EXPECT_FALSE(Envelope::sphere(radius)) << radius;
}

}  // namespace
}  // namespace nodal::geometry
