// Raymeshes of layouts: whole, and as exact as they say.
#include "stitch/mesh/of_layout.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include "stitch/geometry/raymap/registry.h"
#include "tests/support/layouts.h"

namespace nodal::mesh {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using geometry::Envelope;
using geometry::Ray;
using test::layout_of;

constexpr double kDegree = std::numbers::pi / 180;

/// A point of a triangle, drawn evenly.
Vector3d weights(std::mt19937& random) {
  std::uniform_real_distribution<double> part(0, 1);
  double a = part(random), b = part(random);
  if (a + b > 1) a = 1 - a, b = 1 - b;
  return Vector3d(1 - a - b, a, b);
}

struct At {
  Vector3d point;
  Vector2d texture;
};

At at(const Raymesh& mesh, const Raymesh::Triangle& triangle, const Vector3d& w) {
  At sum{Vector3d::Zero(), Vector2d::Zero()};
  for (int k = 0; k < 3; ++k) {
    sum.point += w[k] * mesh.point(triangle[static_cast<std::size_t>(k)]);
    sum.texture += w[k] * mesh.vertices[triangle[static_cast<std::size_t>(k)]].texture;
  }
  return sum;
}

/// Edges of points that have no triangle on their other side.
std::size_t open_edges(const Raymesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const Raymesh::Triangle& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = mesh.vertices[t[k]].point, b = mesh.vertices[t[(k + 1) % 3]].point;
      edges[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  return static_cast<std::size_t>(std::ranges::count_if(edges, [](const auto& edge) { return edge.second != 0; }));
}

/// Girard's formula by the angles, not the one that the program uses.
double solid_angle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const auto angle = [](const Vector3d& p, const Vector3d& q, const Vector3d& r) {
    const Vector3d one = p.cross(q), other = p.cross(r);
    return std::atan2(one.cross(other).norm(), one.dot(other));
  };
  return angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - std::numbers::pi;
}

TEST(MeshOfLayout, EveryLayout_CoversItsRaysOnce_AndIsAsExactAsItSays) {
  std::mt19937 random(1);
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    const std::string name(kind.name);
    const auto layout = layout_of(name, 96);
    if (layout->scattered()) continue;
    for (const std::string shape : {"sphere:1", "cube:2", "icosahedron:3"}) {
      if (shape != "sphere:1" && name == "cylinder_equal_area") continue;
      const Envelope envelope = Envelope::named(shape).value();
      Result<LayoutMesh> made = mesh_of_layout(*layout, envelope, 0.5 * kDegree);
      ASSERT_TRUE(made) << name << " " << shape << ": " << made.error().text();
      EXPECT_LE(made->error, 0.5 * kDegree) << name;
      ASSERT_TRUE(check_raymesh(made->mesh)) << name << " " << shape << check_raymesh(made->mesh).error().text();
      double covered = 0, worst = 0;
      for (const Raymesh::Triangle& triangle : made->mesh.triangles) {
        covered +=
            solid_angle(made->mesh.point(triangle[0]), made->mesh.point(triangle[1]), made->mesh.point(triangle[2]));
        const At inside = at(made->mesh, triangle, weights(random));
        const auto ray = layout->ray(inside.texture.x() * layout->width(), inside.texture.y() * layout->height());
        ASSERT_TRUE(ray) << name;
        worst = std::max(worst, angle_between(*ray, Ray::towards(inside.point)));
      }
      EXPECT_LE(worst, 0.5 * kDegree) << name << " " << shape;
      if (!test::holds_whole_sphere(kind)) {
        // A zone between two latitudes, less the flat pieces at its sides.
        const double side = name == "mercator" ? std::tanh(std::numbers::pi) : std::sin(45 * kDegree);
        EXPECT_NEAR(covered, 4 * std::numbers::pi * side, 0.1);
        continue;
      }
      EXPECT_EQ(open_edges(made->mesh), 0U) << name << " " << shape;
      EXPECT_NEAR(covered, 4 * std::numbers::pi, 1e-6) << name << " " << shape;
    }
  }
}

TEST(MeshOfLayout, Vertices_AreOnTheEnvelopeAtTheLayoutsRay) {
  const auto layout = layout_of("octahedron", 64);
  const Envelope envelope = Envelope::named("cylinder:2,3").value();
  const LayoutMesh made = mesh_of_layout(*layout, envelope, 1 * kDegree).value();
  for (std::uint32_t k = 0; k < made.mesh.vertices.size(); ++k) {
    const geometry::Angles angles = made.mesh.angles(k);
    const double across = std::cos(angles.phi), up = std::abs(std::sin(angles.phi));
    EXPECT_NEAR(made.mesh.rho(k), std::min(2 / across, 1.5 / std::max(up, 1e-9)), 1e-9);
  }
}

TEST(MeshOfLayout, SmallerErrors_TakeMoreTriangles_BySquareLaw) {
  const auto layout = layout_of("equirectangular", 1024);
  const Envelope sphere = Envelope::named("sphere:1").value();
  const std::size_t coarse = mesh_of_layout(*layout, sphere, 1 * kDegree).value().mesh.triangles.size();
  const std::size_t fine = mesh_of_layout(*layout, sphere, 0.25 * kDegree).value().mesh.triangles.size();
  EXPECT_NEAR(static_cast<double>(fine) / static_cast<double>(coarse), 4, 1.5);
  const Result<LayoutMesh> finest = mesh_of_layout(*layout, sphere, 1e-6 * kDegree);
  ASSERT_FALSE(finest);
  EXPECT_EQ(finest.error().code, Errc::kTooLarge);
}

TEST(MeshOfLayout, FullersMap_IsASubdividedIcosahedronOfNearlyEqualEdges) {
  const Envelope sphere = Envelope::named("sphere:1").value();
  const LayoutMesh fuller = mesh_of_layout(*layout_of("dymaxion", 330), sphere, 0.2 * kDegree).value();
  const LayoutMesh flat = mesh_of_layout(*layout_of("icosahedron", 330), sphere, 0.2 * kDegree).value();
  EXPECT_EQ(fuller.mesh.triangles.size() % 20, 0U);
  EXPECT_LT(edge_ratio(fuller.mesh), 1.2);
  // If flat faces are cut evenly, edges in the middle span up to (R / r)^2 = 1.58 times more; r is the radius of the
  // inscribed sphere.
  EXPECT_GT(edge_ratio(flat.mesh), 1.4);
}

/// By trying all triangles: those whose circle is empty.
TEST(MeshOfLayout, ScatteredRays_AreTheTrianglesWhoseCircleIsEmpty) {
  const Envelope sphere = Envelope::named("sphere:2").value();
  for (const std::string name : {"hammersley", "halton", "stratified_random:seed=4"}) {
    const auto layout = layout_of(name, 24);
    Result<LayoutMesh> made = mesh_of_layout(*layout, sphere, 1);
    ASSERT_TRUE(made) << name;
    const std::size_t rays = static_cast<std::size_t>(layout->width() * layout->height());
    EXPECT_EQ(made->mesh.triangles.size(), 2 * rays - 4) << name << ": by Euler's formula";
    EXPECT_EQ(open_edges(made->mesh), 0U) << name;
    ASSERT_TRUE(check_raymesh(made->mesh)) << name;
    for (const Raymesh::Triangle& t : made->mesh.triangles) {
      const Vector3d a = made->mesh.point(t[0]), b = made->mesh.point(t[1]), c = made->mesh.point(t[2]);
      const Vector3d outward = (c - a).cross(b - a).normalized();
      for (const Vector3d& point : made->mesh.points)
        EXPECT_LE(outward.dot(point - a), 1e-5) << name << ": outside of the convex hull's face";
      const At corner = at(made->mesh, t, Vector3d::UnitX());
      const Ray ray = layout->ray(corner.texture.x() * layout->width(), corner.texture.y() * layout->height()).value();
      EXPECT_LE(angle_between(ray, Ray::towards(a)), 1e-9) << name;
    }
  }
}

TEST(CheckRaymesh, FoldsAndBacks_AreRefusedByTheTrianglesNumber) {
  const auto cube = [] {
    return mesh_of_layout(*layout_of("cube", 48), Envelope::named("sphere:1").value(), 5 * kDegree).value().mesh;
  };
  Raymesh turned = cube();
  std::swap(turned.triangles[6][0], turned.triangles[6][1]);
  const Status fold = check_raymesh(turned);
  ASSERT_FALSE(fold);
  EXPECT_NE(fold.error().message.find("triangle 7 folds over"), std::string::npos) << fold.error().message;
  Raymesh twice = cube();
  twice.triangles.push_back(twice.triangles[2]);
  EXPECT_NE(check_raymesh(twice).error().message.find("folds over"), std::string::npos);
  Raymesh moved = cube();
  for (Vector3d& point : moved.points) point += Vector3d(0, 0, 2);
  EXPECT_NE(check_raymesh(moved).error().message.find("from the nodal point"), std::string::npos);
  Raymesh inside_out = cube();
  for (Raymesh::Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  EXPECT_TRUE(check_raymesh(inside_out)) << "the other way around is the same mesh";
}

}  // namespace
}  // namespace nodal::mesh
