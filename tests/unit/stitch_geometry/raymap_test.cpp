// Raymap layouts: the formulas, sizes and names of each.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <set>

#include "raymap_examples.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {
namespace {

/// The largest and the smallest solid angle of whole pixels.
std::pair<double, double> extremes(const RaymapLayout& layout) {
  double least = 1e300, most = 0;
  for (int j = 0; j < layout.height(); ++j) {
    for (int i = 0; i < layout.width(); ++i) {
      if (layout.solid_angle(i, j) == 0 || !is_whole(layout, i, j)) continue;
      least = std::min(least, layout.solid_angle(i, j));
      most = std::max(most, layout.solid_angle(i, j));
    }
  }
  return {most, least};
}

double ratio_at(std::string_view name, int width, int height) {
  const auto layout = made(name, width, height);
  const auto [most, least] = extremes(*layout);
  return most / least;
}

TEST(DualParaboloid, LargestToSmallestSolidAngle_TendsToFour) {
  EXPECT_NEAR(ratio_at("dual_paraboloid", 1200, 600), 4, 0.03);  // §4.2
}

TEST(DualFisheye, LargestToSmallestSolidAngle_TendsToHalfOfPi) {
  EXPECT_NEAR(ratio_at("dual_fisheye", 1200, 600), kPi / 2, 0.01);
}

TEST(Equirectangular, LargestToSmallestSolidAngle_GrowsWithoutBound) {
  // The sine of half a row's height: infinity as H grows (§4.2).
  EXPECT_NEAR(ratio_at("equirectangular", 8, 1000), 1 / std::sin(kPi / 2000), 0.1);
}

TEST(EquiangularCube, LargestToSmallestSolidAngle_TendsToThreeRootThreeOverFour) {
  // At a corner tan' is twice that of the centre in both directions, and 3 sqrt 3 remains as on the cube.
  EXPECT_NEAR(ratio_at("equiangular_cube", 900, 600), std::max(3 * std::sqrt(3.0) / 4, std::sqrt(2.0)), 0.01);
}

TEST(FlatFaces, LargestToSmallestSolidAngle_TendsToTheCubeOfCornerOverMiddle) {
  // A plane at the distance h spans h / d^3 sr per area at the distance d.
  EXPECT_NEAR(ratio_at("octahedron", 800, 800), 3 * std::sqrt(3.0), 0.04);
  EXPECT_NEAR(ratio_at("tetrahedron", 1000, 434), 27, 0.7);
  const double golden = (1 + std::sqrt(5.0)) / 2, corner = std::sqrt(golden * std::sqrt(5.0)) / 2;
  // Distance of the middle of a face of an icosahedron with edges of length 1.
  const double middle = golden * golden / (2 * std::sqrt(3.0));
  EXPECT_NEAR(ratio_at("icosahedron", 800, 278), std::pow(corner / middle, 3), 0.03);
}

TEST(EquiangularCube, EachRow_IsOneStripOfTheSphere) {
  // Left front right, and down back up with the sky on the right.
  const auto layout = made("equiangular_cube", 300, 200);
  for (const double x : {100.0, 200.0}) {
    for (const double y : {20.0, 50.0, 90.0, 120.0, 150.0, 190.0}) {
      EXPECT_LE(angle_between(*layout->ray(x - 1e-6, y), *layout->ray(x + 1e-6, y)), 1e-6) << x << "," << y;
    }
  }
  EXPECT_LE(angle_between(*layout->ray(150, 50), Ray::towards(0, 0, 1)), 1e-14);
  EXPECT_LE(angle_between(*layout->ray(150, 150), Ray::towards(0, 0, -1)), 1e-14);
  EXPECT_LE(angle_between(*layout->ray(250, 150), Ray::towards(0, -1, 0)), 1e-14);
}

TEST(Sinusoidal_Healpix_Cylinder, AllWholePixels_SpanTheSame) {
  EXPECT_NEAR(ratio_at("healpix", 64, 48), 1, 1e-12);
  EXPECT_NEAR(ratio_at("cylinder_equal_area", 200, 64), 1, 1e-10);
  EXPECT_NEAR(ratio_at("sinusoidal", 400, 200), 1, 1e-10);
}

TEST(CompressedSpherical, PixelsWithoutARay_TendToOneMinusTwoOverPi) {
  const auto empty = [](int width) {
    const auto layout = made("compressed_spherical", width, width / 2);
    double count = 0;
    for (int j = 0; j < layout->height(); ++j) {
      for (int i = 0; i < width; ++i) count += layout->ray(i + 0.5, j + 0.5) ? 0 : 1;
    }
    return count / width / (width / 2);
  };
  const double coarse = std::abs(empty(128) - (1 - 2 / kPi)), fine = std::abs(empty(2048) - (1 - 2 / kPi));
  EXPECT_LT(coarse, 2.0 / 128);
  EXPECT_LT(fine, 2.0 / 2048);
}

TEST(Hammersley, FirstPoints_AreThoseByHand) {
  // 8 points: z = (k + 1/2) / 4 - 1, and k = 0 1 2 3 mirrored in base 2 is 0, 1/2, 1/4, 3/4.
  const auto layout = made("hammersley", 4, 2);
  const auto expect_at = [&](double x, double theta, double z) {
    const double across = std::sqrt(1 - z * z);
    EXPECT_LE(angle_between(*layout->ray(x, 0.5), Ray::towards(std::sin(theta) * across, z, std::cos(theta) * across)),
              1e-15);
  };
  expect_at(0.5, -kPi, -7.0 / 8);
  expect_at(1.5, 0, -5.0 / 8);
  expect_at(2.5, -kPi / 2, -3.0 / 8);
  expect_at(3.5, kPi / 2, -1.0 / 8);
}

TEST(StratifiedRandom, Seed_DecidesAllRays) {
  const auto one = made("stratified_random", 16, 8), same = made("stratified_random:seed=1", 16, 8);
  const auto other = made("stratified_random:seed=2", 16, 8);
  EXPECT_EQ(one->ray(3, 3)->direction(), same->ray(3, 3)->direction());
  EXPECT_NE(one->ray(3, 3)->direction(), other->ray(3, 3)->direction());
  for (int j = 0; j < 8; ++j) {
    for (int i = 0; i < 16; ++i) {
      const Ray ray = *one->ray(i + 0.5, j + 0.5);
      EXPECT_TRUE(ray.y() >= j / 4.0 - 1 && ray.y() <= (j + 1) / 4.0 - 1);
      EXPECT_TRUE(i == 0 || ray.angles().theta >= one->ray(i - 0.5, j + 0.5)->angles().theta);
    }
  }
}

TEST(Healpix, KnownPlaces) {
  // Base face 4 of HEALPix is about longitude 0 on the equator: behind, as longitude pi is forward.
  const auto layout = made("healpix", 400, 300);
  EXPECT_LE(angle_between(*layout->ray(50, 150), Ray::towards(0, 0, -1)), 1e-14);
  EXPECT_LE(angle_between(*layout->ray(250, 150), Ray::towards(0, 0, 1)), 1e-14);
  EXPECT_LE(angle_between(*layout->ray(100 - 1e-9, 0), Ray::towards(0, -1, 0)), 1e-7)
      << "north is the upper right corner";
  EXPECT_LE(angle_between(*layout->ray(0, 300), Ray::towards(0, 1, 0)), 1e-7)
      << "south the lower left one of the last row";
  // The centre of a polar face: sine of latitude 2/3, longitude 45 degrees from behind to the right.
  const double z = 2.0 / 3, across = std::sqrt(1 - z * z) * std::sqrt(0.5);
  EXPECT_LE(angle_between(*layout->ray(50, 50), Ray::towards(-across, -z, -across)), 1e-14);
}

TEST(DualFisheye, RimAndMiddle_AreWhereTwoUprightCamerasSeeThem) {
  const auto layout = made("dual_fisheye", 400, 200);
  const auto expect_ray = [&](double x, double y, const Ray& ray) {
    EXPECT_LE(angle_between(*layout->ray(x, y), ray), 1e-9) << x << "," << y;
  };
  expect_ray(100, 100, Ray::towards(0, 0, 1));
  expect_ray(150, 100, Ray::towards(1, 0, 1));
  expect_ray(100, 50, Ray::towards(0, -1, 1));
  expect_ray(300, 100, Ray::towards(0, 0, -1));
  expect_ray(350, 100, Ray::towards(-1, 0, -1));
  expect_ray(300, 50, Ray::towards(0, -1, -1));
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
  const auto layout = make_layout("gnomonic", 100, 100);
  ASSERT_FALSE(layout);
  EXPECT_EQ(layout.error().code, Errc::kUnsupported);
  EXPECT_NE(layout.error().message.find("'gnomonic'; there are: equirectangular, cube"), std::string::npos)
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
  constexpr double kMax = kMaxRaymapSide;
  for (const LayoutKind& kind : layout_kinds()) {
    const LayoutName name = LayoutName::parse(kind.name).value();
    for (const double width : {1.0, 2.0, 3.9, 4.0, 5.0, 99.0, 100.1, 2048.0, 4000.0, kMax, kMax + 1, 1e9, 1e300,
                               std::numeric_limits<double>::infinity(), 0.0, -1.0, -1e300, std::nan("")}) {
      const RaymapSize size = name.size_for_width(width);
      EXPECT_TRUE(size.width > 600 || make_layout(name, size.width, size.height)) << kind.name << " " << width;
      EXPECT_TRUE(name.check_size(size)) << kind.name << " " << width;
      EXPECT_TRUE(size.width % 2 == 0 && size.height % 2 == 0) << kind.name << " " << width;
      EXPECT_LE(std::max(size.width, size.height), kMaxRaymapSide);
      if (width > 0 && width <= kMax / 2) {
        EXPECT_GE(size.width, width) << kind.name;
        EXPECT_LT(size.width, width + kind.step.width) << kind.name << ": the smallest of them";
      }
    }
  }
}

TEST(WidthForResolution, NeighbouringPixels_AreOneOverTheResolutionApartWhereTheyAreLargest) {
  for (const LayoutKind& kind : layout_kinds()) {
    const LayoutName name = LayoutName::parse(kind.name).value();
    const RaymapSize size = name.size_for_width(name.width_for_resolution(150));
    const auto layout = make_layout(name, size.width, size.height).value();
    if (kind.name == "stratified_random") continue;  // by chance
    double largest = 0;
    for (int j = 0; j < size.height; j += 3) {
      for (int i = 0; i < size.width; i += 3) largest = std::max(largest, layout->solid_angle(i, j));
    }
    EXPECT_LE(std::sqrt(largest) * 150, 1.002) << kind.name;
    EXPECT_GE(std::sqrt(largest) * 150, 0.985) << kind.name;
  }
}

TEST(LayoutName, ParametersAreReadAndWritten) {
  EXPECT_EQ(LayoutName::parse("cube").value().text(), "cube");
  EXPECT_EQ(LayoutName::parse("cube:pad=0").value().text(), "cube") << "the usual value is not part of the name";
  EXPECT_EQ(LayoutName::parse("cube:pad=64").value().text(), "cube:pad=64");
  EXPECT_EQ(LayoutName::parse("stratified_random:seed=4294967295").value().value(), 4294967295);
  for (const char* bad : {"cube:", "cube:pad", "cube:pad=", "cube:pad=65", "cube:pad=-1", "cube:pad=1x", "cube:seed=1",
                          "cube:pad=99999999999999999999", "stratified_random:seed=4294967296", "healpix:pad=1"}) {
    const auto name = LayoutName::parse(bad);
    ASSERT_FALSE(name) << bad;
    EXPECT_EQ(name.error().code, Errc::kBadValue) << bad;
  }
  EXPECT_NE(LayoutName::parse("cube:pad=65").error().message.find("pad=N, a whole number from 0 to 64"),
            std::string::npos);
  EXPECT_EQ(LayoutName::parse("").error().code, Errc::kUnsupported);
}

TEST(MakeLayout, ImpossibleSizes_NameANearPossibleOne) {
  const auto expect_refused = [](std::string_view text, int width, int height, std::string_view says) {
    const auto layout = make_layout(text, width, height);
    ASSERT_FALSE(layout) << text;
    EXPECT_EQ(layout.error().code, Errc::kBadValue);
    EXPECT_NE(layout.error().message.find(says), std::string::npos) << layout.error().message;
  };
  expect_refused("cube:pad=8", 48, 32, "51x34 would be");
  expect_refused("cube_cross", 400, 200, "400x300 would be");
  expect_refused("dual_fisheye", 400, 300, "600x300 would be");
  expect_refused("octahedron", 31, 31, "32x32 would be");
  expect_refused("healpix", 402, 300, "404x303 would be");
  expect_refused("compressed_spherical", 31, 16, "32 would be");
  expect_refused("hammersley", 0, 16, "1 to 32768");
}

}  // namespace
}  // namespace nodal::geometry
