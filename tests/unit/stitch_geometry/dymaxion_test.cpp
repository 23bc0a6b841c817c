// Fuller's dymaxion map.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "raymap_examples.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {
namespace {

constexpr int kWidth = 1100, kHeight = 520;  // 200 px an edge
const double kEdgeAngle = std::atan(2.0);    // between two corners of an icosahedron

/// A place on the Earth: longitude 0 is forward, north is up.
Ray earth(double latitude, double longitude) { return Ray::at(Angles{longitude * kPi / 180, -latitude * kPi / 180}); }

TEST(Dymaxion, CornersOfTheNet_AreWhereFullerPutThem) {
  // Latitude and longitude of Fuller's corners (Gray 1995, to 1e-5 degrees) and where they are in units of edges.
  const auto layout = made("dymaxion", kWidth, kHeight);
  const auto expect = [&](double latitude, double longitude, double edges, int row) {
    const double y = kHeight * (1 - row / 3.0), middle = 0.5 * kHeight;
    const auto ray = layout->ray(edges * 200, y + (y > middle ? -1e-9 : 1e-9));
    ASSERT_TRUE(ray);
    EXPECT_LE(angle_between(*ray, earth(latitude, longitude)), 1e-5) << latitude << " " << longitude;
  };
  expect(64.70000, 10.53620, 2.5, 2);
  expect(2.30088, -5.24539, 2, 3);
  expect(10.44735, 58.15771, 1.5, 2);
  expect(39.10000, 122.30000, 2, 1);
  expect(50.10320, -143.47849, 3, 1);
  expect(23.71793, -67.13233, 3.5, 2);
  expect(-39.10000, -57.70000, 4.5, 2);
  expect(-50.10320, 36.52151, 0.5, 2);
}

TEST(Dymaxion, AlongEdges_TheAngleGrowsEvenly) {
  // From corner 1 to corner 5, inside of the net: faces meet there.
  const auto layout = made("dymaxion", kWidth, kHeight);
  const auto at = [&](double part) { return *layout->ray(500 + part * 100, kHeight * (1 + part) / 3.0); };
  const Ray from = at(0);
  EXPECT_NEAR(angle_between(from, at(1)), kEdgeAngle, 1e-9);
  for (const double part : {0.1, 0.25, 0.5, 0.8}) {
    EXPECT_NEAR(angle_between(from, at(part)), part * kEdgeAngle, 1e-9) << part;
  }
}

TEST(Dymaxion, MiddleOfAFace_IsTheMiddleOfItsCorners) {
  const auto layout = made("dymaxion", kWidth, kHeight);
  const Eigen::Vector3d sum =
      earth(64.7, 10.5362).direction() + earth(39.1, 122.3).direction() + earth(50.1032, -143.47849).direction();
  EXPECT_LE(angle_between(*layout->ray(500, kHeight * (1 - (2 - 2.0 / 3) / 3)), Ray::towards(sum)), 1e-5);
}

TEST(Dymaxion, NeighbouringFaces_MeetOnTheNet) {
  // Rays do not jump at the slanted edges between the faces of the middle row that are about corners 1, 4 and 5.
  const auto layout = made("dymaxion", kWidth, kHeight);
  int joined = 0;
  for (double row = 1.03; row < 2; row += 0.02) {
    const double y = kHeight * (1 - row / 3);
    for (const double slant : {-0.5, 0.5}) {
      for (double edges = 0.5 + slant * row - 3; edges < 3.4; edges += 1) {
        if (edges < 1.6) continue;
        const auto left = layout->ray(edges * 200 - 0.01, y), right = layout->ray(edges * 200 + 0.01, y);
        ASSERT_TRUE(left && right);
        EXPECT_LE(angle_between(*left, *right), 0.03 * kEdgeAngle / 200) << edges << " " << row;
        ++joined;
      }
    }
  }
  EXPECT_GT(joined, 150);
}

/// Whether a pixel is in one triangle of the net: no line of the triangular lattice passes through it.
bool in_one_triangle(int i, int j) {
  for (const auto& [across, down] : {std::pair(0.0, 1.0), std::pair(1.0, 0.5), std::pair(1.0, -0.5)}) {
    const auto side = [&](int x, int y) {
      return std::floor(across * (5.5 * x / kWidth - 0.5) + down * 3 * (1 - 1.0 * y / kHeight));
    };
    if (side(i, j) != side(i + 1, j) || side(i, j) != side(i, j + 1) || side(i, j) != side(i + 1, j + 1)) return false;
  }
  return true;
}

TEST(Dymaxion, SolidAngle_IsTheAreaThatThePixelsRaysSpan_ToAStatedBound) {
  const auto layout = made("dymaxion", kWidth, kHeight);
  std::mt19937 random(2);
  int compared = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const int i = static_cast<int>(random() % kWidth), j = static_cast<int>(random() % kHeight);
    if (!in_one_triangle(i, j) || !layout->ray(i + 0.5, j + 0.5)) continue;
    const auto density = [&](double x, double y) {
      const double h = 1e-4;
      const Eigen::Vector3d dx = layout->ray(x + h, y)->direction() - layout->ray(x - h, y)->direction();
      const Eigen::Vector3d dy = layout->ray(x, y + h)->direction() - layout->ray(x, y - h)->direction();
      return dx.cross(dy).norm() / (4 * h * h);
    };
    double area = 0;
    for (int part = 0; part < 16; ++part) {
      area += density(i + (part % 4 + 0.5) / 4, j + (part / 4 + 0.5) / 4) / 16;
    }
    ++compared;
    EXPECT_NEAR(layout->solid_angle(i, j) / area, 1, 1e-5) << i << "," << j;
  }
  EXPECT_GT(compared, 1000);
}

TEST(Dymaxion, PixelsAreMoreEvenThanOnTheFlatFaces) {
  const auto ratio = [](std::string_view name, int width, int height) {
    const auto layout = made(name, width, height);
    double least = 1e300, most = 0;
    for (int j = 0; j < height; ++j) {
      for (int i = 0; i < width; ++i) {
        if (!is_whole(*layout, i, j)) continue;
        least = std::min(least, layout->solid_angle(i, j)), most = std::max(most, layout->solid_angle(i, j));
      }
    }
    return most / least;
  };
  EXPECT_LT(ratio("dymaxion", 660, 312), ratio("icosahedron", 600, 208));
}

}  // namespace
}  // namespace nodal::geometry
