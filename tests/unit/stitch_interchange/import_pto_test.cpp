// Hugin's numbers, calculated by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/response.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

ImportResult imported(std::string_view text) {
  Result<ImportResult> import = import_project(text, "rig");
  EXPECT_TRUE(import) << (import ? "" : import.error().text());
  return import ? *import : ImportResult{};
}

TEST(ImportPto, Rectilinear_HasItsFocalAndCentre) {
  const auto import = imported("i w1000 h600 f0 v90 y0 p0 r0 d10 e-4 n\"a.png\"\n");
  ASSERT_EQ(import.calibration.heads.size(), 1u);
  const HeadCalibration& head = import.calibration.heads[0];
  EXPECT_EQ(head.name, "a");
  const auto& lens = std::get<RectilinearLens>(head.lens);
  ASSERT_EQ(lens.coefficients.size(), 1u);
  EXPECT_NEAR(lens.coefficients[0], 500, 1e-10);  // 500 / tan 45
  EXPECT_EQ(head.center_x, 510);                  // (1000 - 1) / 2 + 10, plus 1/2 for the pixel's centre
  EXPECT_EQ(head.center_y, 296);
  EXPECT_EQ(head.aspect, 1);
  EXPECT_TRUE(import.notes.empty()) << import.notes[0];
  EXPECT_EQ(import.calibration.name, "rig");
}

TEST(ImportPto, FisheyePolynomial_IsTheSameCurve) {
  const double a = 0.03, b = -0.1, c = 0.02;
  const auto import = imported("i w1200 h800 f3 v120 a0.03 b-0.1 c0.02 y0 p0 r0 n\"a\"\n");
  const auto& lens = std::get<EquidistantLens>(import.calibration.heads[0].lens);
  const double f = 1200 / (120 * kRadiansPerDegree), n = 400;
  for (const double t : {0.1, 0.5, 0.9}) {
    const double p = f * t / n;
    const double hugin = n * (a * std::pow(p, 4) + b * std::pow(p, 3) + c * p * p + (1 - a - b - c) * p);
    double ours = 0;
    for (std::size_t k = 0; k < lens.coefficients.size(); ++k) ours += lens.coefficients[k] * std::pow(t, k + 1);
    EXPECT_NEAR(ours, hugin, 1e-10);
  }
}

TEST(ImportPto, YawPitchRoll_PointTheHead) {
  const auto import = imported("i w100 h100 f0 v60 y90 p0 r0 n\"right\"\ni w100 h100 f0 v60 y0 p90 r0 n\"up\"\n");
  const auto heads = *geometry::make_heads(import.calibration);
  EXPECT_LE(geometry::angle_between(heads[0].axis(), geometry::Ray::towards(1, 0, 0)), 1e-12);
  EXPECT_LE(geometry::angle_between(heads[1].axis(), geometry::Ray::towards(0, -1, 0)), 1e-12);
}

TEST(ImportPto, LinkedVariables_TakeTheFirstImages) {
  const auto import =
      imported("i w100 h100 f3 v150 a0.01 b0 c0 d1 e2 n\"a\"\ni w100 h100 f3 v=0 a=0 b=0 c=0 d=0 e=0 n\"b\"\n");
  EXPECT_EQ(import.calibration.heads[0].lens, import.calibration.heads[1].lens);
  EXPECT_EQ(import.calibration.heads[1].center_y, 52);
}

TEST(ImportPto, CropOfACircularFisheye_IsACircle) {
  const auto import = imported("i w1600 h1200 f2 v180 S210,1410,-20,1180 n\"a\"\n");
  const Region& region = import.calibration.heads[0].region;
  EXPECT_EQ(region, (Region{210, 0, 1410, 1180, Region::Circle{810, 580, 600}}));
  EXPECT_TRUE(import.notes.empty());
}

TEST(ImportPto, CropOfAFullFrame_IsARectangle) {
  const auto import = imported("i w1600 h1200 f3 v150 S10,1500,20,1190 n\"a\"\n");
  EXPECT_EQ(import.calibration.heads[0].region, (Region{10, 20, 1500, 1190, {}}));
}

TEST(ImportPto, ExposuresWhiteBalanceAndVignetting_BecomeGainAndVignetting) {
  const auto import = imported(
      "i w800 h600 f0 v60 Eev10 Er1.2 Eb0.8 Va2 Vb-0.4 Vc0.1 Vd-0.02 Vx4 Vy-6 n\"a\"\n"
      "i w800 h600 f0 v60 Eev12 Er1 Eb1 n\"b\"\n");
  const HeadCalibration& head = import.calibration.heads[0];
  // The mean is 11; the first picture received twice the light.
  EXPECT_NEAR(head.gain[1], 2, 1e-12);
  EXPECT_NEAR(head.gain[0], 2.4, 1e-12);
  EXPECT_NEAR(head.gain[2], 1.6, 1e-12);
  EXPECT_NEAR(import.calibration.heads[1].gain[1], 0.5, 1e-12);
  EXPECT_EQ(head.vignetting.x, 404);
  EXPECT_EQ(head.vignetting.y, 294);
  EXPECT_EQ(head.vignetting.radius, 500);  // half the diagonal
  EXPECT_NEAR(head.vignetting.coefficients[0], -0.2, 1e-15);
  EXPECT_NEAR(head.vignetting.coefficients[2], -0.01, 1e-15);
  EXPECT_TRUE(import.notes.empty());
}

TEST(ImportPto, MeanResponse_IsHuginsOwn) {
  const auto import = imported("i w800 h600 f0 v60 Eev1 n\"a\"\ni w800 h600 f0 v60 Eev2 n\"b\"\n");
  const Response& response = import.calibration.heads[0].response;
  // Nona 2022's 16-bit output for these values at Eev 0 in a panorama at E1, E2, E4 and E-1.
  struct {
    double stops, in, out;
  } const kByNona[] = {{1, 512.0 / 2047, 0.14862287},  {1, 1024.0 / 2047, 0.3054551},  {1, 1536.0 / 2047, 0.51270314},
                       {2, 1024.0 / 2047, 0.18077363}, {4, 1536.0 / 2047, 0.11116197}, {-1, 512.0 / 2047, 0.4186923}};
  for (const auto& [stops, in, out] : kByNona) {
    const double light = geometry::decode(response, in) * std::exp2(-stops);
    EXPECT_NEAR(geometry::encode(response, light), out, 0.001) << in << " by " << stops;
  }
}

TEST(ImportPto, FittedResponse_IsReplacedByTheMeanAndSaidSo) {
  const auto import = imported("i w800 h600 f0 v60 Ra0.5 n\"a\"\n");
  EXPECT_EQ(import.calibration.heads[0].response.curve, Response::Curve::kPolynomial);
  ASSERT_EQ(import.notes.size(), 1u);
  EXPECT_NE(import.notes[0].find("mean camera curve"), std::string::npos);
}

TEST(ImportPto, VignettingThatGoesDark_IsLeftOutAndSaidSo) {
  const auto import = imported("i w800 h600 f0 v60 Va1 Vb-2 n\"a\"\n");
  EXPECT_EQ(import.calibration.heads[0].vignetting.coefficients, (std::array<double, 3>{}));
  ASSERT_FALSE(import.notes.empty());
  EXPECT_NE(import.notes[0].find("goes dark"), std::string::npos);
}

TEST(ImportPto, Masks_HideThePixelsOfTheirImage) {
  const auto import = imported(
      "i w800 h600 f0 v60 n\"a\"\ni w800 h600 f0 v60 n\"b\"\n"
      "k i1 t0 p\"-0.5 9.5 30 10 40.5 400\"\nk i1 t2 p\"700 1 790 1 790 90 700 90\"\n");
  EXPECT_TRUE(import.notes.empty());
  EXPECT_TRUE(import.calibration.heads[0].region.masks.empty());
  ASSERT_EQ(import.calibration.heads[1].region.masks.size(), 2u);
  using Point = Region::Point;  // pixel centres at + 1/2
  EXPECT_EQ(import.calibration.heads[1].region.masks[0],
            (std::vector{Point{0, 10}, Point{30.5, 10.5}, Point{41, 400.5}}));
  EXPECT_EQ(import.calibration.heads[1].region.masks[1].size(), 4u);
}

TEST(ImportPto, MasksThatHaveNoCounterpart_AreNotedAndLeftOut) {
  const std::string image = "i w800 h600 f0 v60 n\"a\"\n";
  std::string long_one = "k i0 t0 p\"0 0";
  for (int k = 0; k < 100'000; ++k) long_one += k % 2 == 0 ? " 300 1" : " 5 200";
  for (const std::string& line :
       {std::string("k i0 t1 p\"0 0 90 0 90 90\""), std::string("k i0 t3 p\"0 0 90 0 90 90\""),
        std::string("k i0 t0 p\"0 0 90 0\""), std::string("k i0 t0 p\"\""), std::string("k i0 t0 p\"0 0 9 9 5 5\""),
        std::string("k i0 t0 p\"900 1 990 1 990 90\""), std::string("k i0 t0 p\"0 0 90 0 9e300 90\""),
        long_one + "\""}) {
    const auto import = imported(image + line + "\n");
    EXPECT_TRUE(import.calibration.heads.at(0).region.masks.empty()) << line.substr(0, 60);
    ASSERT_EQ(import.notes.size(), 1u) << line.substr(0, 60);
    EXPECT_NE(import.notes[0].find("Head 'a', line 2"), std::string::npos) << import.notes[0];
  }
  for (const char* line : {"k i1 t0 p\"0 0 90 0 90 90\"", "k i0.5 t0 p\"0 0 90 0 90 90\"", "k i-1 t0 p\"0 0 9 0 9 9\"",
                           "k t0 p\"0 0 90 0 90 90\"", "k i0 p\"0 0 90 0 90 90\"", "k i0 t0 p\"0 0 90 0 90\"",
                           "k i0 t0 p\"0 0 nan 0 90 90\"", "k i0 t0 p\"0 0 x 0 90 90\""}) {
    const auto import = import_project(image + line + "\n", "rig");
    ASSERT_FALSE(import) << line;
    EXPECT_NE(import.error().message.find("line 2"), std::string::npos) << import.error().message;
  }
}

TEST(ImportPto, ShearAndShift_AreNoted) {
  const auto import = imported("i w800 h600 f0 v60 g3 TrX0.1 n\"a\"\n");
  ASSERT_EQ(import.notes.size(), 2u);
  EXPECT_NE(import.notes[0].find("'g' = 3 of head 'a', a shear of its picture"), std::string::npos);
  EXPECT_NE(import.notes[1].find("'TrX' = 0.1 of head 'a', a shift of its viewpoint"), std::string::npos);
}

TEST(ImportPto, LensThatTurnsBackInItsPicture_IsCappedAndSaidSo) {
  // r = n (1.3 p - 0.3 p^3) turns at p = sqrt(1.3 / 0.9), r = 1.0415 n; the corners are 1.66 n away.
  const auto import = imported("i w800 h600 f3 v120 b-0.3 n\"a\"\n");
  const HeadCalibration& head = import.calibration.heads[0];
  const double turn = std::sqrt(1.3 / 0.9) * 300 / (800 / (120 * kRadiansPerDegree));
  EXPECT_NEAR(head.max_angle, 0.99 * turn, 1e-9);
  ASSERT_EQ(import.notes.size(), 1u);
  EXPECT_NE(import.notes[0].find("has its largest radius"), std::string::npos);
}

TEST(ImportPto, NamesThatAreAlikeOrOdd_BecomeNamesOfHeads) {
  const auto import = imported(
      "i w8 h8 f0 v60 n\"C:\\dir\\my cam.jpg\"\ni w8 h8 f0 v60 n\"/x/my cam.png\"\ni w8 h8 f0 v60\n"
      "i w8 h8 f0 v60 n\"\xff\xfe.tif\"\n");
  ASSERT_EQ(import.calibration.heads.size(), 4u);
  EXPECT_EQ(import.calibration.heads[0].name, "my_cam");
  EXPECT_EQ(import.calibration.heads[1].name, "my_cam-2");
  EXPECT_EQ(import.calibration.heads[2].name, "head2");
  EXPECT_EQ(import.calibration.heads[3].name, "__");
}

TEST(ImportPto, ControlPoints_AreMovedToOurPixels_AndLinesAreNot) {
  const auto import = imported(
      "i w800 h600 f0 v60 n\"a\"\ni w800 h600 f0 v60 n\"b\"\nc n0 N1 x10 y20.5 X30 Y40 t0\nc n0 N0 x1 y2 X3 Y4 "
      "t1\n");
  ASSERT_EQ(import.control_points.size(), 1u);
  EXPECT_EQ(import.control_points[0].head_b, 1u);
  EXPECT_EQ(import.control_points[0].pixel_a, (geometry::Pixel{10.5, 21}));
  EXPECT_EQ(import.control_points[0].pixel_b, (geometry::Pixel{30.5, 40.5}));
}

}  // namespace
}  // namespace nodal::interchange
