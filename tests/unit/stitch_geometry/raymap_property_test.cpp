// Raymap layouts: the properties of all.
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <set>

#include "examples.h"
#include "raymap_examples.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {
namespace {

/// The solid angle that a layout covers.
double covered(const RaymapLayout& layout) {
  if (layout.name() == "mercator") return 4 * kPi * std::tanh(kPi);
  if (layout.name() != "central_cylinder") return 4 * kPi;
  // Between two circles of latitude; the sizes above tell the two fields of view apart.
  const double half_fov = (layout.width() == 300 ? 45 : 75) * kPi / 180;
  return 4 * kPi * std::sin(half_fov);
}

TEST(EveryLayout, AllKinds_AreInTheList) {
  std::set<std::string_view> listed;
  for (const auto& layout : every_layout()) listed.insert(layout->name());
  EXPECT_EQ(listed.size(), layout_kinds().size());
}

TEST(EveryLayout, SolidAngles_SumToTheSphere) {
  for (const auto& layout : every_layout()) {
    double sum = 0;
    for (int j = 0; j < layout->height(); ++j) {
      double row = 0;
      for (int i = 0; i < layout->width(); ++i) {
        const double angle = layout->solid_angle(i, j);
        EXPECT_GE(angle, 0) << described(*layout) << " " << i << "," << j;
        // Padding holds rays, but represents none.
        const bool held = layout->ray(i + 0.5, j + 0.5).has_value();
        EXPECT_TRUE(held || angle == 0) << described(*layout) << " " << i << "," << j;
        row += angle;
      }
      sum += row;
    }
    EXPECT_NEAR(sum / covered(*layout), 1, 1e-11) << described(*layout);
  }
}

TEST(EveryLayout, PixelOfItsRay_IsThePixel) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> within(0.01, 0.99);
  for (const auto& layout : every_layout()) {
    int whole = 0;
    for (int trial = 0; trial < 4000; ++trial) {
      const int i = static_cast<int>(random() % static_cast<unsigned>(layout->width()));
      const int j = static_cast<int>(random() % static_cast<unsigned>(layout->height()));
      // Inside a pixel, because on the seams a ray has two positions.
      const double x = i + (layout->scattered() ? 0.5 : within(random)),
                   y = j + (layout->scattered() ? 0.5 : within(random));
      if (!layout->scattered() && !is_whole(*layout, i, j)) continue;
      ++whole;
      const std::optional<Pixel> pixel = layout->pixel(layout->ray(x, y).value());
      ASSERT_TRUE(pixel) << described(*layout) << " " << x << "," << y;
      EXPECT_NEAR(pixel->x, x, 1e-8 * layout->width()) << described(*layout) << " " << y;
      EXPECT_NEAR(pixel->y, y, 1e-8 * layout->width()) << described(*layout) << " " << x;
    }
    EXPECT_GT(whole, 4000 * 0.3) << described(*layout);
  }
}

RC_GTEST_PROP(EveryLayout, RayOfThePixelOfAnyRay_IsTheRay, ()) {
  const Eigen::Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
  RC_PRE(v.norm() > 0.01);
  static const auto layouts = every_layout();
  for (const auto& layout : layouts) {
    if (layout->scattered()) continue;
    const std::optional<Pixel> pixel = layout->pixel(Ray::towards(v));
    if (!pixel) {
      const double least = layout->name() == "mercator" ? std::tanh(kPi) : std::sin(kPi / 4);
      RC_ASSERT(covered(*layout) < 4 * kPi && std::abs(v.y()) > v.norm() * least);
      continue;
    }
    const std::optional<Ray> ray = layout->ray(pixel->x, pixel->y);
    RC_ASSERT(ray.has_value());
    RC_ASSERT(angle_between(*ray, Ray::towards(v)) <= 1e-11);
  }
}

TEST(EveryLayout, SolidAngle_IsTheAreaThatThePixelsRaysSpan) {
  std::mt19937 random(6);
  for (const auto& layout : every_layout()) {
    if (layout->scattered() || layout->name() == "dymaxion") continue;  // dymaxion: see below
    int compared = 0;
    for (int trial = 0; trial < 400; ++trial) {
      const int i = static_cast<int>(random() % static_cast<unsigned>(layout->width()));
      const int j = static_cast<int>(random() % static_cast<unsigned>(layout->height()));
      if (!is_whole(*layout, i, j)) continue;
      // Gauss's four-point rule for |dr/dx x dr/dy| over each of 4 x 4 parts of the pixel.
      const double h = 1e-5;
      const auto density = [&](double x, double y) {
        const auto difference = [&](double dx, double dy) -> Eigen::Vector3d {
          return (layout->ray(x + dx, y + dy)->direction() - layout->ray(x - dx, y - dy)->direction()) / (2 * h);
        };
        return difference(h, 0).cross(difference(0, h)).norm();
      };
      double area = 0;
      bool kink = false;  // an edge between two faces passes through the pixel
      for (int part = 0; part < 16; ++part) {
        const double g = 0.125 / std::sqrt(3.0), x = i + (part % 4 + 0.5) / 4, y = j + (part / 4 + 0.5) / 4;
        for (const double dx : {-g, g}) {
          for (const double dy : {-g, g}) {
            area += density(x + dx, y + dy) / 64;
            kink |= layout->name().ends_with("hedron") && density(x + dx, y + dy) > 1.2 * density(i + 0.5, j + 0.5);
          }
        }
      }
      // Across an edge between faces the rule is exact to the edge's part of the pixel only.
      if (layout->name().ends_with("hedron")) {
        const Eigen::Vector3d middle = layout->ray(i + 0.5, j + 0.5)->direction();
        double bent = 0;
        for (const double dx : {-0.5, 0.5}) {
          for (const double dy : {-0.5, 0.5}) {
            const Eigen::Vector3d a = layout->ray(i + 0.5 + 0.98 * dx, j + 0.5 + 0.98 * dy)->direction();
            const Eigen::Vector3d b = layout->ray(i + 0.5 - 0.98 * dx, j + 0.5 - 0.98 * dy)->direction();
            bent = std::max(bent, middle.cross(a).cross(middle.cross(b)).norm() /
                                      (middle.cross(a).norm() * middle.cross(b).norm()));
          }
        }
        if (kink || bent > 1e-6) continue;
      }
      ++compared;
      EXPECT_NEAR(layout->solid_angle(i, j) / area, 1, 1e-5) << described(*layout) << " " << i << "," << j;
    }
    EXPECT_GT(compared, 60) << described(*layout);
  }
}

TEST(EveryLayout, OutsideThePicture_HoldsNoRay) {
  for (const auto& layout : every_layout()) {
    EXPECT_FALSE(layout->ray(-0.1, 5)) << described(*layout);
    EXPECT_FALSE(layout->ray(5, layout->height() + 0.1)) << described(*layout);
    EXPECT_FALSE(layout->ray(std::nan(""), 5)) << described(*layout);
    const double x = layout->name() == "cube_cross" ? layout->width() * 0.4 : layout->width();
    const bool round = layout->name() == "sinusoidal" || layout->name() == "compressed_spherical" ||
                       layout->name() == "dymaxion" || layout->name() == "hammer" || layout->name().starts_with("dual");
    EXPECT_EQ(layout->ray(x, layout->height()).has_value(), !round) << described(*layout);
  }
}

TEST(ScatteredRays, PixelOfAnyRay_HasTheNearestRay) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const auto& layout : every_layout()) {
    if (!layout->scattered()) continue;
    for (int trial = 0; trial < 300; ++trial) {
      Eigen::Vector3d v(normal(random), normal(random), normal(random));
      if (trial < 2) v = {0, trial == 0 ? 1.0 : -1.0, 0};
      if (trial == 2) v = {0, 0, -1};
      const Ray ray = Ray::towards(v);
      double nearest = 10;
      for (int j = 0; j < layout->height(); ++j) {
        for (int i = 0; i < layout->width(); ++i) {
          nearest = std::min(nearest, angle_between(*layout->ray(i + 0.5, j + 0.5), ray));
        }
      }
      const Pixel found = layout->pixel(ray).value();
      EXPECT_NEAR(angle_between(*layout->ray(found.x, found.y), ray), nearest, 1e-9) << described(*layout);
    }
  }
}

TEST(ScatteredRays, PixelsOfHaltonAPeriodApart_FillACompactCell) {
  const auto layout = make_layout("halton", 256, 128).value();
  const std::uint32_t pixels = 256 * 128;
  for (const std::int64_t rays : {20, 64, 1000}) {
    const RaymapLayout::Cells cells = layout->cells(rays, 8);
    const auto period = static_cast<std::uint32_t>(cells.count);
    ASSERT_GT(period, 1U);
    ASSERT_EQ(cells.run, 1U);
    ASSERT_EQ(cells.of(period + 3), 3U);
    EXPECT_GE(pixels / period, rays);
    EXPECT_LT(pixels / period / 3, rays);
    const double area = 4 * kPi / period;  // area in sin phi and theta, which is a solid angle
    for (std::uint32_t first = 0; first < period; ++first) {
      double least[2] = {10, 10}, most[2] = {-10, -10};
      for (std::uint32_t k = first; k < pixels; k += period) {
        const Ray ray = layout->ray(k % 256 + 0.5, k / 256 + 0.5).value();
        const double at[2] = {ray.direction().y(), ray.angles().theta};
        for (int n = 0; n < 2; ++n) least[n] = std::min(least[n], at[n]), most[n] = std::max(most[n], at[n]);
      }
      const double height = most[0] - least[0], width = most[1] - least[1];
      ASSERT_LE(height * width, area);
      ASSERT_LE(std::max(height, width), std::sqrt(3 * area));
    }
  }
  EXPECT_EQ(layout->cells(pixels, 8).count, 1U);
}

TEST(ScatteredRays, ConsecutivePixelsOfHammersley_AreBandsAroundTheSphere) {
  const auto layout = make_layout("hammersley", 256, 128).value();
  const std::uint64_t pixels = 256 * 128;
  const RaymapLayout::Cells cells = layout->cells(100, 8);
  ASSERT_GE(cells.count * cells.run, pixels);
  ASSERT_LT((cells.count - 1) * cells.run, pixels);
  double least_height = 10;
  double above = -2;  // the largest sin phi of the bands before
  for (std::uint64_t cell = 0; cell < cells.count; ++cell) {
    double least[2] = {10, 10}, most[2] = {-10, -10};
    for (std::uint64_t k = 0; k < pixels; ++k) {
      if (cells.of(k) != cell) continue;
      const Ray ray = layout->ray(static_cast<double>(k % 256) + 0.5, static_cast<double>(k / 256) + 0.5).value();
      const double at[2] = {ray.direction().y(), ray.angles().theta};
      for (int n = 0; n < 2; ++n) least[n] = std::min(least[n], at[n]), most[n] = std::max(most[n], at[n]);
    }
    EXPECT_GT(least[0], above);
    above = most[0];
    EXPECT_GT(most[1] - least[1], 0.95 * 2 * kPi);
    if (cell + 1 < cells.count) least_height = std::min(least_height, std::asin(most[0]) - std::asin(least[0]));
  }
  // Eight times the distance of evenly spread rays, at the equator; between two bands there is a ray's distance less.
  const double apart = std::sqrt(4 * kPi / static_cast<double>(pixels));
  EXPECT_NEAR(least_height, 8 * apart, 0.1 * apart);
  EXPECT_EQ(layout->cells(5000, 8).run, 5000U);
}

TEST(ScatteredRays, WithoutARegularOrder_HaveNoCells) {
  for (const auto& layout : every_layout()) {
    if (layout->name() == "halton" || layout->name() == "hammersley") continue;
    EXPECT_EQ(layout->cells(64, 8).count, 0U) << described(*layout);
  }
}

}  // namespace
}  // namespace nodal::geometry
