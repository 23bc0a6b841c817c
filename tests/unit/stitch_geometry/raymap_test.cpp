// Raymap layouts: the formulas of each, and the properties of all.
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "examples.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {
namespace {

constexpr double kPi = std::numbers::pi;

std::unique_ptr<RaymapLayout> made(std::string_view name, int width, int height) {
  Result<std::unique_ptr<RaymapLayout>> layout = make_layout(name, width, height);
  EXPECT_TRUE(layout) << (layout ? "" : layout.error().text());
  return std::move(*layout);
}

std::vector<std::unique_ptr<RaymapLayout>> every_layout() {
  std::vector<std::unique_ptr<RaymapLayout>> layouts;
  layouts.push_back(made("equirectangular", 2048, 1024));
  layouts.push_back(made("equirectangular", 77, 31));
  layouts.push_back(made("cube", 1536, 1024));
  layouts.push_back(made("cube", 3 * 37, 2 * 37));
  return layouts;
}

TEST(EveryLayout, SolidAngles_SumToTheSphere) {
  for (const auto& layout : every_layout()) {
    double sum = 0;
    for (int j = 0; j < layout->height(); ++j) {
      double row = 0;
      for (int i = 0; i < layout->width(); ++i) row += layout->solid_angle(i, j);
      sum += row;
    }
    EXPECT_NEAR(sum / (4 * kPi), 1, 1e-12) << layout->name() << " " << layout->width();
  }
}

RC_GTEST_PROP(EveryLayout, PixelOfItsRay_IsThePixel, ()) {
  for (const auto& layout : every_layout()) {
    // Inside a pixel, because on the seams a ray has two positions.
    const double x = *rc::gen::inRange(0, layout->width()) + between(0.01, 0.99);
    const double y = *rc::gen::inRange(0, layout->height()) + between(0.01, 0.99);
    const std::optional<Ray> ray = layout->ray(x, y);
    RC_ASSERT(ray.has_value());
    const std::optional<Pixel> pixel = layout->pixel(*ray);
    RC_ASSERT(pixel.has_value());
    RC_ASSERT(std::abs(pixel->x - x) <= 1e-8 * layout->width());
    RC_ASSERT(std::abs(pixel->y - y) <= 1e-8 * layout->width());
  }
}

RC_GTEST_PROP(EveryLayout, RayOfThePixelOfAnyRay_IsTheRay, ()) {
  const Eigen::Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
  RC_PRE(v.norm() > 0.01);
  for (const auto& layout : every_layout()) {
    const std::optional<Pixel> pixel = layout->pixel(Ray::towards(v));
    RC_ASSERT(pixel.has_value());
    const std::optional<Ray> ray = layout->ray(pixel->x, pixel->y);
    RC_ASSERT(ray.has_value());
    RC_ASSERT(angle_between(*ray, Ray::towards(v)) <= 1e-12);
  }
}

RC_GTEST_PROP(EveryLayout, SolidAngle_IsTheAreaThatThePixelsRaysSpan, ()) {
  for (const auto& layout : every_layout()) {
    if (layout->scattered()) continue;
    const int i = *rc::gen::inRange(0, layout->width());
    const int j = *rc::gen::inRange(0, layout->height());
    // Gauss's four-point rule for |dr/dx x dr/dy| over the pixel.
    const double g = 0.5 / std::sqrt(3.0), h = 1e-4;
    double area = 0;
    for (const double x : {i + 0.5 - g, i + 0.5 + g}) {
      for (const double y : {j + 0.5 - g, j + 0.5 + g}) {
        const Eigen::Vector3d dx = (layout->ray(x + h, y)->direction() - layout->ray(x - h, y)->direction()) / (2 * h);
        const Eigen::Vector3d dy = (layout->ray(x, y + h)->direction() - layout->ray(x, y - h)->direction()) / (2 * h);
        area += dx.cross(dy).norm() / 4;
      }
    }
    RC_ASSERT(std::abs(layout->solid_angle(i, j) / area - 1) <= 1e-5);
  }
}

TEST(EveryLayout, OutsideThePicture_HoldsNoRay) {
  for (const auto& layout : every_layout()) {
    EXPECT_FALSE(layout->ray(-0.1, 5));
    EXPECT_FALSE(layout->ray(5, layout->height() + 0.1));
    EXPECT_FALSE(layout->ray(std::nan(""), 5));
    EXPECT_TRUE(layout->ray(layout->width(), layout->height()));
  }
}

TEST(Equirectangular, MiddleIsForward_RightIsRight_TopIsUp) {
  const auto layout = made("equirectangular", 400, 200);
  EXPECT_LE(angle_between(*layout->ray(200, 100), Ray::towards(0, 0, 1)), 1e-15);
  EXPECT_LE(angle_between(*layout->ray(300, 100), Ray::towards(1, 0, 0)), 1e-15);
  EXPECT_LE(angle_between(*layout->ray(200, 0), Ray::towards(0, -1, 0)), 1e-15);
  EXPECT_LE(angle_between(*layout->ray(0, 100), Ray::towards(0, 0, -1)), 1e-15);
}

TEST(Equirectangular, RowsOfSolidAngle_AreDifferencesOfSines) {
  const auto layout = made("equirectangular", 100, 50);
  for (const int j : {0, 7, 24, 49}) {
    const double top = kPi * (j / 50.0 - 0.5), bottom = kPi * ((j + 1) / 50.0 - 0.5);
    EXPECT_NEAR(layout->solid_angle(3, j), 2 * kPi / 100 * (std::sin(bottom) - std::sin(top)), 1e-15);
  }
}

TEST(Cube, LargestToSmallestSolidAngle_TendsToThreeRootThree) {
  // The centre of a face compared with its corner (§4.2).
  const auto layout = made("cube", 3 * 2000, 2 * 2000);
  const double ratio = layout->solid_angle(1000, 1000) / layout->solid_angle(0, 0);
  EXPECT_NEAR(ratio, 3 * std::sqrt(3.0), 0.006);
  const auto coarse = made("cube", 3 * 1000, 2 * 1000);
  const double coarse_ratio = coarse->solid_angle(500, 500) / coarse->solid_angle(0, 0);
  EXPECT_NEAR(2 * ratio - coarse_ratio, 3 * std::sqrt(3.0), 1e-5);  // extrapolated to a pixel size of zero
}

TEST(Cube, FacesLieAsCbmpSaysAndStandUpright) {
  const auto layout = made("cube", 300, 200);
  const auto expect_ray = [&](double x, double y, const Ray& ray) {
    EXPECT_LE(angle_between(*layout->ray(x, y), ray), 1e-14) << x << "," << y;
  };
  // Face centres: right left up / down front back.
  expect_ray(50, 50, Ray::towards(1, 0, 0));
  expect_ray(150, 50, Ray::towards(-1, 0, 0));
  expect_ray(250, 50, Ray::towards(0, -1, 0));
  expect_ray(50, 150, Ray::towards(0, 1, 0));
  expect_ray(150, 150, Ray::towards(0, 0, 1));
  expect_ray(250, 150, Ray::towards(0, 0, -1));
  // Half way to the right and half way up from a face's centre.
  expect_ray(75, 25, Ray::towards(1, -0.5, -0.5));
  expect_ray(175, 25, Ray::towards(-1, -0.5, 0.5));
  expect_ray(275, 25, Ray::towards(0.5, -1, -0.5));
  expect_ray(75, 125, Ray::towards(0.5, 1, 0.5));
  expect_ray(175, 125, Ray::towards(0.5, -0.5, 1));
  expect_ray(275, 125, Ray::towards(-0.5, -0.5, -1));
}

TEST(MakeLayout, UnknownName_SaysWhichThereAre) {
  const auto layout = make_layout("mercator", 100, 100);
  ASSERT_FALSE(layout);
  EXPECT_EQ(layout.error().code, Errc::kUnsupported);
  EXPECT_NE(layout.error().message.find("'mercator'; there are: equirectangular, cube"), std::string::npos)
      << layout.error().text();
}

TEST(MakeLayout, SizeThatIsNone_SaysWhatIs) {
  EXPECT_EQ(make_layout("equirectangular", 0, 100).error().code, Errc::kBadValue);
  EXPECT_EQ(make_layout("equirectangular", 100, 40000).error().code, Errc::kBadValue);
  EXPECT_EQ(make_layout("cube", -3, -2).error().code, Errc::kBadValue);
  const auto layout = make_layout("cube", 2048, 1024);
  ASSERT_FALSE(layout);
  EXPECT_NE(layout.error().message.find("2049x1366 would be"), std::string::npos) << layout.error().text();
  EXPECT_TRUE(make_layout("cube", 2049, 1366));
}

TEST(SizeForWidth, EveryLayoutAtAnyWidth_IsASizeThatItCanHaveAndHalvedChromaFits) {
  constexpr double kMost = kMaxRaymapSide;
  for (const std::string_view name : layout_names()) {
    for (const double width : {1.0, 2.0, 3.9, 4.0, 5.0, 99.0, 100.1, 2048.0, 4000.0, kMost, kMost + 1, 1e9, 1e300,
                               std::numeric_limits<double>::infinity(), 0.0, -1.0, -1e300, std::nan("")}) {
      const RaymapSize size = size_for_width(name, width).value();
      const auto layout = make_layout(name, size.width, size.height);
      ASSERT_TRUE(layout) << name << " " << width << ": " << layout.error().text();
      EXPECT_TRUE(size.width % 2 == 0 && size.height % 2 == 0) << name << " " << width;
      if (width > 0 && width <= kMost - 8) {
        EXPECT_GE(size.width, width);
        EXPECT_LT(size.width, width + 8) << "the smallest of them";
      }
    }
  }
  EXPECT_EQ(size_for_width("mercator", 100).error().code, Errc::kUnsupported);
}

TEST(WidthForResolution, NeighbouringPixels_AreOneOverTheResolutionApartWhereTheyAreLargest) {
  for (const std::string_view name : layout_names()) {
    const RaymapSize size = size_for_width(name, width_for_resolution(name, 300).value()).value();
    const auto layout = make_layout(name, size.width, size.height).value();
    double largest = 0;
    for (int j = 0; j < size.height; j += 7) {
      for (int i = 0; i < size.width; i += 7) largest = std::max(largest, layout->solid_angle(i, j));
    }
    // Both layouts' pixels are square where they are largest.
    EXPECT_LE(std::sqrt(largest) * 300, 1.0) << name;
    EXPECT_GE(std::sqrt(largest) * 300, 0.99) << name;
  }
}

TEST(LayoutNames, AllCanBeMade) {
  for (const std::string_view name : layout_names()) EXPECT_TRUE(make_layout(name, 600, 400)) << name;
}

}  // namespace
}  // namespace nodal::geometry
