// Interpolation between scattered rays.
#include "stitch/view/natural_neighbours.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::view {
namespace {

using geometry::Ray;

struct Layout {
  std::unique_ptr<geometry::RaymapLayout> made;

  Layout(const std::string& name, int width, int height) : made(geometry::make_layout(name, width, height).value()) {}
  const geometry::ScatteredRays& rays() const { return dynamic_cast<const geometry::ScatteredRays&>(*made); }
  Eigen::Vector3d at(int i, int j) const { return made->ray(i + 0.5, j + 0.5)->direction(); }
};

Ray random_ray(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Ray::towards(normal(random), normal(random), normal(random));
}

TEST(NaturalNeighbours, OfAPixelsOwnRay_IsThePixel) {
  const Layout layout("hammersley", 40, 20);
  for (const auto& [i, j] : {std::pair(0, 0), std::pair(17, 9), std::pair(39, 19)}) {
    const auto found = natural_neighbours(layout.rays(), Ray::towards(layout.at(i, j)));
    ASSERT_EQ(found.size(), 1U);
    EXPECT_TRUE(found[0].i == i && found[0].j == j && found[0].weight == 1);
  }
}

TEST(NaturalNeighbours, AnyRay_AreThoseOfTheConvexHullWithTheirEdges) {
  // On the sphere, the Delaunay triangles are the faces of the convex hull, and the corners of Voronoi cells their
  // normals.
  std::mt19937 random(3);
  for (const char* name : {"hammersley", "halton", "stratified_random:seed=4"}) {
    const Layout layout(name, 10, 6);
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::Vector3d q = random_ray(random).direction();
      std::map<std::pair<int, int>, std::vector<Eigen::Vector3d>> corners;
      for (int a = 0; a < 60; ++a) {
        for (int b = 0; b < a; ++b) {
          const Eigen::Vector3d pa = layout.at(a % 10, a / 10), pb = layout.at(b % 10, b / 10);
          Eigen::Vector3d normal = (pa - q).cross(pb - q);
          if (normal.dot(q) < 0) normal = -normal;
          bool face = true;
          for (int c = 0; c < 60 && face; ++c) face = c == a || c == b || normal.dot(layout.at(c % 10, c / 10) - q) < 0;
          if (!face) continue;
          for (const int k : {a, b})
            corners[{k % 10, k / 10}].push_back(normal / normal.dot(q));  // on the tangent plane
        }
      }
      double sum = 0;
      for (const auto& [pixel, ends] : corners) {
        ASSERT_EQ(ends.size(), 2U);
        sum += (ends[0] - ends[1]).norm() / (layout.at(pixel.first, pixel.second) - q).norm();
      }
      const auto found = natural_neighbours(layout.rays(), Ray::towards(q));
      EXPECT_EQ(found.size(), corners.size()) << name;
      for (const Neighbour& neighbour : found) {
        const auto& ends = corners[{neighbour.i, neighbour.j}];
        ASSERT_EQ(ends.size(), 2U) << name;
        const double edge = (ends[0] - ends[1]).norm() / (layout.at(neighbour.i, neighbour.j) - q).norm();
        EXPECT_NEAR(neighbour.weight, edge / sum, 1e-9) << name;
      }
    }
  }
}

TEST(NaturalNeighbours, MeanOfTheirRays_IsTheRay) {
  // Linear functions are kept, up to the sphere's curvature over a pixel.
  std::mt19937 random(8);
  const Layout layout("stratified_random", 128, 64);
  const double pitch = std::sqrt(4 * 3.14159265 / 128 / 64);
  for (int trial = 0; trial < 300; ++trial) {
    const Ray ray = random_ray(random);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double sum = 0;
    for (const Neighbour& neighbour : natural_neighbours(layout.rays(), ray)) {
      EXPECT_GT(neighbour.weight, 0);
      mean += neighbour.weight * layout.at(neighbour.i, neighbour.j);
      sum += neighbour.weight;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_LE(geometry::angle_between(Ray::towards(mean), ray), 0.02 * pitch);
  }
}

TEST(NaturalNeighbours, FewRays_AreStillAWeightedMean) {
  std::mt19937 random(9);
  for (const auto& [width, height] :
       {std::pair(1, 1), std::pair(2, 1), std::pair(3, 1), std::pair(2, 2), std::pair(5, 1)}) {
    const Layout layout("halton", width, height);
    for (int trial = 0; trial < 50; ++trial) {
      double sum = 0;
      for (const Neighbour& neighbour : natural_neighbours(layout.rays(), random_ray(random))) sum += neighbour.weight;
      EXPECT_NEAR(sum, 1, 1e-12) << width << "x" << height;
    }
  }
}

}  // namespace
}  // namespace nodal::view
