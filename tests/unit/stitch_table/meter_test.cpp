#include "stitch/table/meter_compiler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace nodal::table {
namespace {

/// One head of 90 degrees that looks forward: it sees exactly a sixth of the sphere.
Calibration one_head() {
  Calibration calibration;
  HeadCalibration head;
  head.name = "cam0";
  head.width = head.height = 200;
  head.center_x = head.center_y = 100;
  head.lens = RectilinearLens{{100}};
  head.region = {0, 0, 200, 200, std::nullopt};
  head.vignetting = {100, 100, 100, {}};
  calibration.heads = {head};
  return calibration;
}

TEST(MeterTable, Cells_AddUpToTheSphereAndAHeadSeesThePartOfItThatItsFieldSpans) {
  const auto table = compile_meter_table(one_head()).value();
  std::uint64_t all = 0;
  for (const auto& cell : table.cells) all += cell.solid_angle;
  EXPECT_NEAR(static_cast<double>(all), 1 << 24, 2048);
  std::vector<std::uint8_t> grey(200 * 200, 128);
  const ImageView picture = packed_image(PixelFormat::kGrey8, 200, 200, std::as_const(grey).data());
  const blend::SphereLight seen = blend::meter(table, {&picture, 1}, std::array<blend::ExposedHead, 1>{});
  EXPECT_NEAR(seen.heads[0].solid_angle / double{1 << 24}, 1.0 / 6, 0.004);
  EXPECT_NEAR(seen.light, 1024 * std::log2(128 / 255.0), 2);
}

TEST(MeterTable, ABrightPole_CountsByTheSphereItCoversAndNotByPixels) {
  // A head that looks up; light 1/2 within 20 degrees of the zenith and 1/8 outside.
  Calibration calibration = one_head();
  calibration.heads[0].R_head_rig = {1, 0, 0, 0, 0, 1, 0, -1, 0};
  const auto table = compile_meter_table(calibration).value();
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      const double tangent = std::hypot(x + 0.5 - 100, y + 0.5 - 100) / 100;
      pixels.push_back(tangent < std::tan(20 * std::numbers::pi / 180) ? 128 : 32);
    }
  }
  const ImageView picture = packed_image(PixelFormat::kGrey8, 200, 200, std::as_const(pixels).data());
  const blend::SphereLight seen = blend::meter(table, {&picture, 1}, std::array<blend::ExposedHead, 1>{});
  // Share of what the head sees; counted by pixels it would be 0.104.
  const double cap = (1 - std::cos(20 * std::numbers::pi / 180)) / 2 * 6;
  EXPECT_NEAR(seen.light, 1024 * (cap * std::log2(128 / 255.0) + (1 - cap) * std::log2(32 / 255.0)), 60);
}

TEST(Meter, AHeadClips_ItsNeighbourThatDoesNotSaysHowBrightItIs) {
  Calibration calibration = one_head();
  calibration.heads.push_back(calibration.heads[0]);
  calibration.heads[1].name = "cam1";
  const auto table = compile_meter_table(calibration).value();
  EXPECT_EQ(table.heads[0].overlaps, 2U);
  const std::vector<std::uint8_t> full(200 * 200, 255), level(200 * 200, 100);
  const std::array<ImageView, 2> pictures{packed_image(PixelFormat::kGrey8, 200, 200, full.data()),
                                          packed_image(PixelFormat::kGrey8, 200, 200, level.data())};
  const std::array<blend::ExposedHead, 2> settings{{{12 * kStop, 0}, {8 * kStop, 0}}};
  blend::SphereLight seen = blend::meter(table, pictures, settings);
  const double truth = 1024 * std::log2(100 / 255.0) - 8 * kStop;
  EXPECT_NEAR(seen.heads[0].light, truth, 2);
  EXPECT_EQ(seen.heads[0].clipped, seen.heads[0].solid_angle);
  // Alone it gives only a lower bound.
  const std::array<ImageView, 2> alone{pictures[0], ImageView{}};
  seen = blend::meter(table, alone, settings);
  EXPECT_NEAR(seen.heads[0].light, -12 * kStop, 2);
  EXPECT_EQ(seen.heads[1].solid_angle, 0U);
}

TEST(Meter, Gamma_LightIsTheSameWhateverCurveTheHeadHas) {
  const auto table = compile_meter_table(one_head()).value();
  std::vector<std::uint8_t> encoded(200 * 200, static_cast<std::uint8_t>(std::lround(255 * std::pow(0.2, 1 / 2.2))));
  const ImageView picture = packed_image(PixelFormat::kGrey8, 200, 200, std::as_const(encoded).data());
  const std::array<blend::ExposedHead, 1> settings{{{0, 2200}}};
  EXPECT_NEAR(blend::meter(table, {&picture, 1}, settings).light, 1024 * std::log2(0.2), 20);
}

}  // namespace
}  // namespace nodal::table
