// Envelopes: the radial function, the kernel, and what an eye sees.
#include "stitch/geometry/envelope/envelope.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "stitch/geometry/envelope/obj.h"
#include "stitch/geometry/envelope/solid.h"

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
  const Envelope sphere = Envelope::named("sphere:3").value();
  std::mt19937 random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const Vector3d eye = 2.9 * random_ray(random).direction();
    const Ray ray = random_ray(random);
    const Vector3d point = sphere.seen(eye, ray).value();
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
      EXPECT_LE((room.seen(eye, ray).value() - leaves_box(eye, ray.direction())).norm(), 1e-9);
    }
  }
}

TEST(Envelope, FacesThatAllRunAroundTheOtherWay_AreTheSameEnvelope) {
  const Envelope room =
      Envelope::from_obj(box("f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n")).value();
  EXPECT_LE((room.seen(Vector3d::Zero(), Ray::towards(1, 0, 0)).value() - Vector3d(2, 0, 0)).norm(), 1e-12);
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
    const bool outside = eye.x() > 1 && eye.z() > 1, kernel = eye.x() < 1 && eye.z() < 1;
    EXPECT_EQ(room.check_eye(eye).has_value(), outside || kernel) << eye.transpose();
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

/// The corners of each polyhedron by their coordinates in the literature, for the radius 1; nothing else is used below.
std::vector<Vector3d> corners_of(const std::string& name) {
  std::vector<Vector3d> corners;
  if (name == "tetrahedron") corners = {{-1, -1, -1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
  for (int k = 0; name == "octahedron" && k < 3; ++k)
    corners.insert(corners.end(), {Vector3d::Unit(k), -Vector3d::Unit(k)});
  for (int k = 0; name == "cube" && k < 8; ++k) corners.emplace_back(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
  for (Vector3d& corner : corners) corner.normalize();
  return corners;
}

/// Whether a point is in the convex hull of corners: on the inner side of every plane through three of them that has
/// all others on one side. How far it is outside, as a part of the distance of such a plane from the origin; at most 0
/// inside.
double outside_hull(const std::vector<Vector3d>& corners, const Vector3d& point) {
  double most = -1;
  for (std::size_t a = 0; a < corners.size(); ++a) {
    for (std::size_t b = a + 1; b < corners.size(); ++b) {
      for (std::size_t c = b + 1; c < corners.size(); ++c) {
        Vector3d normal = (corners[b] - corners[a]).cross(corners[c] - corners[a]);
        if (normal.norm() < 1e-9 || std::abs(normal.dot(corners[a])) < 1e-9) continue;
        normal /= normal.dot(corners[a]);
        if (std::ranges::all_of(corners, [&](const Vector3d& p) { return normal.dot(p) < 1 + 1e-9; }))
          most = std::max(most, normal.dot(point) - 1);
      }
    }
  }
  return most;
}

/// Twelve corners of an icosahedron: a pole, and a ring at the latitude atan(1/2). The dodecahedron's are its faces'
/// centres.
std::vector<Vector3d> icosahedron() {
  std::vector<Vector3d> corners{{0, 1, 0}, {0, -1, 0}};
  for (int k = 0; k < 10; ++k) {
    const double theta = k * std::acos(-1.0) / 5, y = (k % 2 == 0 ? -1 : 1) / std::sqrt(5.0);
    corners.emplace_back(2 / std::sqrt(5.0) * std::sin(theta), y, 2 / std::sqrt(5.0) * std::cos(theta));
  }
  return corners;
}

std::vector<Vector3d> dodecahedron() {
  const std::vector<Vector3d> of = icosahedron();
  std::vector<Vector3d> corners;
  for (std::size_t a = 0; a < of.size(); ++a) {
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      for (std::size_t c = b + 1; c < of.size(); ++c) {
        if (std::min({of[a].dot(of[b]), of[b].dot(of[c]), of[c].dot(of[a])}) > 0.4)
          corners.push_back((of[a] + of[b] + of[c]).normalized());
      }
    }
  }
  return corners;
}

TEST(Envelope, RegularPolyhedra_AreTheHullsOfTheirCorners) {
  std::mt19937 random(7);
  for (const std::string name : {"tetrahedron", "octahedron", "cube", "dodecahedron", "icosahedron"}) {
    const std::vector<Vector3d> corners = name == "icosahedron"    ? icosahedron()
                                          : name == "dodecahedron" ? dodecahedron()
                                                                   : corners_of(name);
    // A cube is given by its side: of 2 / sqrt 3, its corners are at 1.
    const Envelope envelope = Envelope::named(name + (name == "cube" ? ":1.1547005383792515" : ":1")).value();
    for (const Vector3d& corner : corners) EXPECT_NEAR(envelope.rho(Ray::towards(corner)), 1, 1e-12) << name;
    for (int trial = 0; trial < 300; ++trial) {
      const Ray ray = random_ray(random);
      EXPECT_NEAR(outside_hull(corners, envelope.rho(ray) * ray.direction()), 0, 1e-9) << name;
      const Vector3d eye = 2 * random_ray(random).direction();
      const std::optional<Vector3d> seen = envelope.seen(eye, ray);
      if (!seen) continue;
      EXPECT_NEAR(outside_hull(corners, *seen), 0, 1e-9) << name;
      EXPECT_GT(outside_hull(corners, *seen - 1e-3 * ray.direction()), 0) << name << ": not its near side";
    }
  }
}

TEST(Envelope, CylinderAndParaboloid_HaveTheirRadialFunctions) {
  const Envelope cylinder = Envelope::named("cylinder:2,3").value(), dish = Envelope::named("paraboloid:1.5").value();
  std::mt19937 random(8);
  for (int trial = 0; trial < 300; ++trial) {
    const Ray ray = random_ray(random);
    const double across = std::hypot(ray.x(), ray.z());
    EXPECT_NEAR(cylinder.rho(ray), std::min(2 / across, 1.5 / std::abs(ray.y())), 1e-9);
    // A parabola about its focus: twice the depth, divided by 1 plus the cosine from its axis.
    EXPECT_NEAR(dish.rho(ray), 3 / (1 + std::abs(ray.z())), 1e-9);
  }
}

TEST(Envelope, Kernel_OfASolidIsItsInside_AndOutsideIsAllowed) {
  std::mt19937 random(9);
  std::istringstream names(Solid::names());
  for (std::string name; names >> name;) {
    const std::string shape = name.substr(0, name.find(':'));
    const Envelope envelope = Envelope::named(shape + (shape == "cylinder" ? ":1,2" : ":1")).value();
    for (int trial = 0; trial < 100; ++trial) {
      const Ray out = random_ray(random), look = random_ray(random);
      const double rho = envelope.rho(out);
      const Vector3d in = 0.999 * rho * out.direction(), past = 1.001 * rho * out.direction();
      EXPECT_TRUE(envelope.check_eye(in) && envelope.check_eye(past)) << shape;
      EXPECT_FALSE(envelope.check_eye(rho * out.direction())) << shape << ": on its surface";
      // From inside, every direction meets it once: nothing is between the eye and the point, and the point is on it.
      const Vector3d seen = envelope.seen(in, look).value();
      EXPECT_NEAR(envelope.rho(Ray::towards(seen)), seen.norm(), 1e-9) << shape;
      EXPECT_FALSE(envelope.seen(past, out)) << shape << ": looks away from it";
      const Vector3d near = envelope.seen(past, Ray::towards(-out.direction())).value();
      EXPECT_LE((near - rho * out.direction()).norm(), 1e-9) << shape;
    }
  }
}

/// A sphere of triangles, rows of longitude and latitude, with three bulges.
std::string ball(int rows, int columns) {
  std::string text = "v 0 -1 0\nv 0 1 0\n";
  for (int j = 1; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const double phi = std::acos(-1.0) * (1.0 * j / rows - 0.5), theta = 2 * std::acos(-1.0) * i / columns;
      const double rho = 1 + 0.1 * std::sin(3 * theta) * std::cos(phi);
      text += "v " + std::to_string(rho * std::sin(theta) * std::cos(phi)) + " " + std::to_string(rho * std::sin(phi)) +
              " " + std::to_string(rho * std::cos(theta) * std::cos(phi)) + "\n";
    }
  }
  const auto at = [&](int i, int j) { return " " + std::to_string(3 + (j - 1) * columns + i % columns); };
  for (int i = 0; i < columns; ++i) {
    text += "f 1" + at(i, 1) + at(i + 1, 1) + "\nf 2" + at(i + 1, rows - 1) + at(i, rows - 1) + "\n";
    for (int j = 1; j + 1 < rows; ++j) text += "f" + at(i, j) + at(i, j + 1) + at(i + 1, j + 1) + at(i + 1, j) + "\n";
  }
  return text;
}

TEST(Envelope, MeshOfThousandsOfTriangles_IsSeenAsASearchOfAllTrianglesSeesIt) {
  const std::string text = ball(32, 64);
  const Envelope envelope = Envelope::from_obj(text).value();
  const ObjMesh mesh = read_obj(text, text.size(), 4096).value();
  std::mt19937 random(10);
  int hits = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3d eye = trial % 2 == 0 ? 0.2 * random_ray(random).direction() : 2 * random_ray(random).direction();
    ASSERT_TRUE(envelope.check_eye(eye));
    const Ray look = trial % 2 == 0 ? random_ray(random) : Ray::towards(0.6 * random_ray(random).direction() - eye);
    double nearest = 1e300;  // by Cramer's rule: eye + t d = a + u (b - a) + v (c - a)
    for (const ObjMesh::Triangle& triangle : mesh.triangles) {
      const Vector3d a = mesh.vertices[triangle.corners[0].vertex];
      Eigen::Matrix3d columns;
      columns << mesh.vertices[triangle.corners[1].vertex] - a, mesh.vertices[triangle.corners[2].vertex] - a,
          -look.direction();
      const Vector3d solved = columns.inverse() * (eye - a);
      if (solved.x() >= 0 && solved.y() >= 0 && solved.x() + solved.y() <= 1 && solved.z() > 0)
        nearest = std::min(nearest, solved.z());
    }
    const std::optional<Vector3d> seen = envelope.seen(eye, look);
    ASSERT_EQ(seen.has_value(), nearest < 1e300) << trial;
    if (!seen) continue;
    EXPECT_NEAR((*seen - eye).norm(), nearest, 1e-8) << trial;
    ++hits;
  }
  EXPECT_GT(hits, 200);
}

TEST(Envelope, NamesThatAreNone_AreRefusedAndSayWhatToWrite) {
  for (const std::string text : {"sphere:0", "sphere:-1", "sphere:nan", "sphere:1e7", "sphere:", "sphere", "sphere:1,2",
                                 "cylinder:1", "cylinder:1,", "cylinder:1,2,3", "cube:1x"}) {
    const Result<Envelope> envelope = Envelope::named(text);
    ASSERT_FALSE(envelope) << text;
    EXPECT_EQ(envelope.error().code, Errc::kBadValue) << text;
    EXPECT_NE(envelope.error().message.find("metres"), std::string::npos) << envelope.error().message;
  }
  const Result<Envelope> torus = Envelope::named("torus:1");
  ASSERT_FALSE(torus);
  EXPECT_NE(torus.error().message.find("'torus'; there are: sphere:RADIUS cylinder"), std::string::npos);
}

}  // namespace
}  // namespace nodal::geometry
