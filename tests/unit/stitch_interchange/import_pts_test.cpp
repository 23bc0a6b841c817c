// PTGui's numbers, calculated by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

/// Two fisheyes linked to a dummy line, in PTGui 9's format, with Windows line ends.
constexpr std::string_view kProject =
    "# ptGui project file\r\n"
    "#-vignettingparams \r\n"
    "#-cameracurve 0 0 0\r\n"
    "#-dummyimage\r\n"
    "o w1 h1 y0 r0 p0 v200 a-0.1 b0.2 c-0.05 f2 d60 e10 g0 t0\r\n"
    "#-imgfile 2000 1200 \"left cam.jpg\"\r\n"
    "#-viewpoint 0 0 0 0 0\r\n"
    "#-exposureparams 0 0 0 0\r\n"
    "o f2 y90 r0 p0 v=0 a=0 b=0 c=0 d=0 e=0 g=0 t=0 C100,1700,-200,1400\r\n"
    "#-imgfile 2000 1200 \"right.jpg\"\r\n"
    "o f2 y-90 r0 p0 v=0 a=0 b=0 c=0 d5 e=0 g=0 t=0 C100,1700,-200,1400\r\n"
    "c n1 N2 x10 y20 X30 Y40 t0\r\n";

ImportResult imported_pts(std::string_view text) {
  Result<ImportResult> import = import_project(text, "rig");
  EXPECT_TRUE(import) << (import ? "" : import.error().text());
  return import ? *import : ImportResult{};
}

TEST(ImportPts, WithACrop_EverythingRefersToTheCrop) {
  const auto import = imported_pts(kProject);
  ASSERT_EQ(import.calibration.heads.size(), 2u);
  const HeadCalibration& head = import.calibration.heads[0];
  EXPECT_EQ(head.name, "left_cam");
  EXPECT_EQ(head.width, 2000);
  EXPECT_EQ(head.center_x, 900 + 60);
  EXPECT_EQ(head.center_y, 600 + 10);
  EXPECT_EQ(import.calibration.heads[1].center_x, 905);
  EXPECT_EQ(head.region, (Region{100, 0, 1700, 1200, Region::Circle{900, 600, 800}}));
  const auto& lens = std::get<EquidistantLens>(head.lens);
  const double f = 1600 / (200 * kRadiansPerDegree);
  EXPECT_NEAR(lens.coefficients[0], f * (1 + 0.1 - 0.2 + 0.05), 1e-9);
  EXPECT_NEAR(lens.coefficients[1], f * f / 800 * -0.05, 1e-9);
  EXPECT_NEAR(lens.coefficients[2], f * f * f / (800.0 * 800) * 0.2, 1e-9);
  EXPECT_NEAR(lens.coefficients[3], f * f * f * f / (800.0 * 800 * 800) * -0.1, 1e-9);
}

TEST(ImportPts, ControlPoints_CountTheDummyAndHavePixelCentresAtIntegers) {
  const auto import = imported_pts(kProject);
  ASSERT_EQ(import.control_points.size(), 1u);
  EXPECT_EQ(import.control_points[0].head_a, 0u);
  EXPECT_EQ(import.control_points[0].head_b, 1u);
  EXPECT_EQ(import.control_points[0].pixel_a, (geometry::Pixel{10.5, 20.5}));
}

TEST(ImportPts, EmptyPhotometry_NeedsNoNote) {
  EXPECT_TRUE(imported_pts(kProject).notes.empty()) << imported_pts(kProject).notes[0];
}

TEST(ImportPts, WhatItCannotTake_IsSaid) {
  std::string text(kProject);
  text.replace(text.find("#-vignettingparams "), 19, "#-vignettingparams -0.06 1.3");
  text.replace(text.find("#-cameracurve 0 0 0"), 19, "#-cameracurve 3.4 0 -0.5");
  text.replace(text.find("#-exposureparams 0 0 0 0"), 24, "#-exposureparams 0 0 0 -0.007\r\n#-sourcemask iVBOR");
  const auto import = imported_pts(text);
  ASSERT_EQ(import.notes.size(), 4u);
  EXPECT_NE(import.notes[0].find("vignetting"), std::string::npos);
  EXPECT_NE(import.notes[1].find("camera curve"), std::string::npos);
  EXPECT_NE(import.notes[2].find("exposure"), std::string::npos);
  EXPECT_NE(import.notes[3].find("masks"), std::string::npos);
  EXPECT_EQ(import.calibration.heads[0].gain, (std::array<double, 3>{1, 1, 1}));
}

TEST(ImportPts, WithoutDummyAndCrop_TheWholePictureIsMeant) {
  const auto import = imported_pts("#-imgfile 1000 800 \"a.jpg\"\no f0 v90 y0 p0 r0 a0 b0 c0 d0 e0\n");
  ASSERT_EQ(import.calibration.heads.size(), 1u);
  EXPECT_EQ(import.calibration.heads[0].center_x, 500);
  EXPECT_EQ(import.calibration.heads[0].region, (Region{0, 0, 1000, 800, {}}));
  EXPECT_NEAR(std::get<RectilinearLens>(import.calibration.heads[0].lens).coefficients[0], 500, 1e-10);
}

}  // namespace
}  // namespace nodal::interchange
