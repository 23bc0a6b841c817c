// The tone of a set's exposures: compressed highlights, confidence in heads, and the accuracy of chroma.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "stitch/blend/exposure_tone.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::table {
namespace {

using blend::soften;

TEST(Soften, BelowSevenTenths_ValuesStayAndTheTopIsExactlyFull) {
  for (const std::int64_t top : {32'640, 33'000, 61'344, 250'000}) {
    for (std::int64_t value = 0; value <= 22'848; value += 17) ASSERT_EQ(soften(value, top, 32'640), value);
    EXPECT_LE(std::abs(soften(top, top, 32'640) - 32'640), 2);
    EXPECT_LE(std::abs(soften(2 * top, top, 32'640) - 32'640), 2) << "what is above the top is shown as the top";
  }
}

TEST(Soften, AnyTop_RisesWithoutStepsAndNeverFasterThanTheLight) {
  for (const std::int64_t top : {33'000, 45'000, 61'344, 250'000}) {
    for (std::int64_t value = 0; value < top; ++value) {
      const std::int64_t step = soften(value + 1, top, 32'640) - soften(value, top, 32'640);
      ASSERT_GE(step, -1) << value;  // rounded down twice
      ASSERT_LE(step, 2) << value;
    }
    EXPECT_GT(soften(top, top, 32'640), soften(top - top / 50, top, 32'640));
  }
}

TEST(Soften, OneAndAHalfTimesFullOfTwo_IsReinhardsExtendedCurve) {
  // 0.7 + 0.3 t (1 + t / T^2) / (1 + t), t = 0.8 / 0.3, T = 1.3 / 0.3
  EXPECT_NEAR(static_cast<double>(soften(48'960, 65'280, 32'640)), 32'640 * 0.949161, 3);
}

/// Two heads, four stops apart, with an sRGB response.
blend::SetTone tone_four_stops_apart(PixelFormat format) {
  blend::BlendTable table;
  table.format = format;
  table.sources.resize(2);
  const bool chroma = format == PixelFormat::kI420;
  for (std::size_t c = 0; c < 3; ++c) {
    table.components[c] = {0, static_cast<std::uint8_t>(chroma && c > 0 ? 128 : 0),
                           static_cast<std::uint8_t>(chroma ? std::min<std::size_t>(c, 1) : c)};
  }
  Calibration calibration;
  calibration.heads.resize(2);
  for (HeadCalibration& head : calibration.heads) head.response.curve = Response::Curve::kSrgb;
  const std::array<blend::ExposedHead, 2> heads{{{2 * kStop, 0}, {-2 * kStop, 0}}};
  return blend::tone_of_exposures(table, compile_tone_table(calibration, format), heads);
}

TEST(Trust, AHeadIsClipped_TheOtherHas255TimesItsSayAndOfTwoThatAreTheDarkerHas32Times) {
  for (const PixelFormat format : {PixelFormat::kRgb24, PixelFormat::kI420}) {
    const auto trust = tone_four_stops_apart(format).confidence.value().of_level;
    EXPECT_GE(trust[1][120], 255 * trust[0][255]);
    EXPECT_GE(trust[1][255], 32 * trust[0][255]);
    EXPECT_GE(trust[0][0], 8 * trust[1][0]) << "black: the brighter one knows better";
    EXPECT_GT(trust[1][0], 0) << "black is shown where nobody else looks";
  }
}

double srgb(double light) { return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055; }

std::array<double, 2> chroma_of(const std::array<double, 3>& light, double factor) {
  std::array<double, 3> e{};
  for (std::size_t c = 0; c < 3; ++c) e[c] = 255 * srgb(light[c] * factor);
  const double luma = 0.299 * e[0] + 0.587 * e[1] + 0.114 * e[2];
  return {0.564 * (e[2] - luma), 0.713 * (e[0] - luma)};
}

TEST(ChromaOfSrgbHeads, FourStopsApart_IsUndoneToALevelNearlyAlwaysAndToTwoAndAHalfAtMost) {
  // Chroma is a difference of curved values, so no factor corrects it exactly; this measures the error of one factor,
  // for colours from grey to one channel reduced by three quarters, unclipped in the head.
  const blend::SetTone tone = tone_four_stops_apart(PixelFormat::kI420);
  int colours = 0;
  int over_one = 0;
  double worst = 0;
  for (std::size_t h = 0; h < 2; ++h) {
    const double factor = h == 0 ? 4 : 0.25;
    const double undo = tone.heads[h].gain[1] / 32768.0 * tone.output[1].scale / 256;
    for (double level = 0.05; level < 0.5; level += 0.01) {
      const double grey = std::pow(level, 2.2);
      for (int k = 0; k < 64; ++k) {
        std::array<double, 3> light{grey * (1 - 0.2 * (k % 4)), grey * (1 - 0.2 * (k / 4 % 4)),
                                    grey * (1 - 0.2 * (k / 16))};
        if (std::max({light[0], light[1], light[2]}) * factor > 1) continue;
        const auto seen = chroma_of(light, factor);
        const auto shown = chroma_of(light, 1);
        const double off = std::hypot(seen[0] * undo - shown[0], seen[1] * undo - shown[1]);
        worst = std::max(worst, off);
        over_one += off > 1 ? 1 : 0;
        ++colours;
      }
    }
  }
  std::printf("of %d colours %.1f %% are more than a level off, %.2f at most\n", colours, 100.0 * over_one / colours,
              worst);
  EXPECT_LT(over_one, colours / 10);
  EXPECT_LT(worst, 2.5);
}

}  // namespace
}  // namespace nodal::table
