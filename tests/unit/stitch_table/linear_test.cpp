// 16-bit raymaps: numbers proportional to light, compared with the light in double precision.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/geometry/response.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/tone_compiler.h"
#include "tests/reference/double_blend.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::test {
namespace {

using blend::ExposedHead;

constexpr int kWidth = 32;
constexpr int kHeight = 16;

Response response_of(Response::Curve curve, double gamma = 1) { return {curve, gamma, {}}; }

/// Six heads with one response, overlapping at their rims, and their table, made once.
struct LitRig {
  explicit LitRig(const Response& response)
      : rig(lit_by(response)),
        table(table::compile_blend_table(rig, kSpec, std::vector<PixelFormat>(rig.heads.size(), PixelFormat::kGrey8))
                  .value()),
        tones(table::compile_tone_table(rig, kSpec.format)) {}
  static Calibration lit_by(const Response& response) {
    Calibration rig = cube_rig(48);
    for (HeadCalibration& head : rig.heads) head.response = response;
    return rig;
  }
  static inline const table::RaymapSpec kSpec{"equirectangular", kWidth, kHeight, PixelFormat::kGrey16};
  Calibration rig;
  blend::BlendTable table;
  blend::ToneTable tones;
};

struct Blended {
  blend::LinearScale scale;
  std::vector<std::uint16_t> numbers;
};

/// For GREY heads; levels[h] fills head h's picture.
Blended blend_flat(const LitRig& lit, const std::vector<std::uint8_t>& levels,
                   const std::vector<ExposedHead>& exposed) {
  const blend::SetTone tone = blend::linear_tone(lit.table, lit.tones, exposed);
  Blended blended{blend::linear_scale(lit.tones, tone, exposed), {}};
  std::vector<Picture> pictures;
  std::vector<ImageView> views;
  for (std::size_t h = 0; h < lit.rig.heads.size(); ++h) {
    pictures.emplace_back(PixelFormat::kGrey8, lit.rig.heads[h].width, lit.rig.heads[h].height, levels[h]);
  }
  for (const Picture& picture : pictures) views.push_back(picture.view());
  Picture raymap(LitRig::kSpec.format, kWidth, kHeight, 77);
  blend::blend_rows(lit.table, PreparedHeads(lit.table, views).views(), tone, raymap.mutable_view(), 0, kHeight);
  for (std::size_t i = 0; i < raymap.bytes.size(); i += 2) {
    blended.numbers.push_back(static_cast<std::uint16_t>(raymap.bytes[i] | raymap.bytes[i + 1] << 8));
  }
  return blended;
}

struct Case {
  const char* name;
  Response response;
  /// largest error, of 65535: see the test
  double bound;
  friend void PrintTo(const Case& each, std::ostream* out) { *out << each.name; }
};

/// Error budget. If a head's gain is not one, light is rounded when it is computed from the sample, when the gain is
/// applied, and through the gain's own rounding to 2^-15: half a unit each, so 1.5 of 32640. The scale of exposures, in
/// whole 1/1024 stops rounded twice, adds 0.068 % of light. Light is a power p of the values, so 1.5 become at most 1.5
/// p 65535 / 32640. Curves are linear over 8 levels: h^2 f'' / 16, f'' at most 2.95 for sRGB, is 12 of 65535.
class Linear : public testing::TestWithParam<Case> {};

TEST_P(Linear, EveryLevelByHeadsOfAnyExposure_IsItsLightWithinTheBound) {
  const LitRig lit(GetParam().response);
  double worst = 0;
  double worst_alone = 0;
  for (const int stops : {0, 1, 2, 4}) {
    for (int level = 0; level < 256; level += stops == 0 ? 1 : 5) {
      // Only the first head, which looks forward, has a longer exposure; `level` is its level. The others see the same
      // light rounded to their levels, so only pixels that the first head alone sees are compared.
      std::vector<ExposedHead> exposed(6, {10 * kStop, 0});
      exposed[0].exposure += stops * kStop;
      std::vector<std::uint8_t> levels(6, 0);
      levels[0] = static_cast<std::uint8_t>(level);
      const Blended blended = blend_flat(lit, levels, exposed);
      const double light = geometry::decode(lit.rig.heads[0].response, level / 255.0) * std::exp2(-stops);
      const double number = blended.numbers[kHeight / 2 * kWidth + kWidth / 2];
      const double off = std::abs(number - 65535 * light);
      worst = std::max(worst, off - (stops == 0 ? 0 : 0.00068 * 65535 * light));
      if (stops == 0) worst_alone = std::max(worst_alone, off);
      ASSERT_EQ(blended.scale.full.value(), 10 * kStop) << "what fills the sample of the heads that are exposed least";
    }
  }
  std::printf("%-10s off by %.1f of 65535, exposed alike %.1f\n", GetParam().name, worst, worst_alone);
  EXPECT_LE(worst, GetParam().bound);
  EXPECT_LE(worst_alone, GetParam().bound);
}

INSTANTIATE_TEST_SUITE_P(
    Responses, Linear,
    testing::Values(Case{"linear", response_of(Response::Curve::kLinear), 3.5},
                    Case{"gamma", response_of(Response::Curve::kGamma, 2.2), 7.1},
                    Case{"srgb", response_of(Response::Curve::kSrgb), 12 + 3.5},
                    Case{"polynomial", {Response::Curve::kPolynomial, 1, {0.3, 0.5, 0.2}}, 12 + 3.5}),
    [](const auto& param_info) { return std::string(param_info.param.name); });

TEST(LinearScale, ExposedAlike_LevelsOfAnSrgbPictureComeBack) {
  for (const Response& response : {response_of(Response::Curve::kSrgb), response_of(Response::Curve::kLinear)}) {
    const LitRig lit(response);
    const std::vector<ExposedHead> exposed(6, {10 * kStop, 0});
    const Blended blended = blend_flat(lit, std::vector<std::uint8_t>(6, 0), exposed);
    for (int level = 1; level < 256; ++level) {
      const double v = (level - 0.5) / 255;  // IEC 61966-2-1
      const double light = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
      EXPECT_NEAR(blended.scale.shown_from[static_cast<std::size_t>(level)], 65535 * light, 3) << level;
    }
  }
}

TEST(LinearScale, FourStopsApart_WhiteIsTheMeansAndMoreIsHeldBackBelowIt) {
  const LitRig lit(response_of(Response::Curve::kGamma, 2.2));
  std::vector<ExposedHead> exposed(6, {12 * kStop, 0});
  for (std::size_t h = 0; h < 3; ++h) exposed[h].exposure = 8 * kStop;
  const Blended blended = blend_flat(lit, std::vector<std::uint8_t>(6, 0), exposed);
  const auto& from = blended.scale.shown_from;
  EXPECT_NEAR(*blended.scale.full, 8 * kStop, 1);
  // Half of white at the mean exposure is sRGB 188, above 178 = 0.7 of 255, where compression begins; a quarter is 137
  // and is not compressed.
  EXPECT_NEAR(from[137], 65535 / 4 / 4, 65535 / 4 * 0.006);
  EXPECT_GT(from[188], 65535 / 4 / 2);
  EXPECT_GT(from[255], 65535 * 0.8) << "all that the darker heads see is shown";
  for (std::size_t level = 1; level < 256; ++level) EXPECT_GE(from[level], from[level - 1]);
}

TEST(LinearTone, AHeadSetToAnotherGamma_GivesTheSameLight) {
  const LitRig lit(response_of(Response::Curve::kGamma, 2.2));
  for (const double light : {0.01, 0.1, 0.5, 0.9}) {
    const auto as_calibrated = static_cast<std::uint8_t>(std::lround(255 * std::pow(light, 1 / 2.2)));
    const auto as_set = static_cast<std::uint8_t>(std::lround(255 * light));
    std::vector<ExposedHead> exposed(6, {10 * kStop, 0});
    exposed[0].gamma = 1000;
    std::vector<std::uint8_t> levels(6, as_calibrated);
    levels[0] = as_set;
    const Blended blended = blend_flat(lit, levels, exposed);
    // Linear pieces do not follow x^(1 / 2.2) near 0; heads with such a setting should be calibrated with it.
    const double bound = as_set < 8 ? 0.009 : 0.003;
    EXPECT_NEAR(blended.numbers[kHeight / 2 * kWidth + kWidth / 2], 65535 * as_set / 255.0, 65535 * bound) << light;
    exposed[0].gamma = 2200;
    levels[0] = as_calibrated;
    const Blended same = blend_flat(lit, levels, exposed);
    EXPECT_EQ(same.numbers[kHeight / 2 * kWidth + kWidth / 2], same.numbers[0]);
  }
}

/// A pixel in double precision, as light of 65535, and its change if every head's level rose by one.
struct Expected {
  double number = 0;
  double per_level = 0;
};
Expected expected_of(double in_numbers, double scale, double power) {
  const double part = std::clamp(in_numbers / 255 / scale, 0.0, 1.0);
  return {65535 * std::pow(part, power), 65535 * power * std::pow(part, power - 1) / 255 / scale};
}

RC_GTEST_PROP(LinearBlend, AnyRigWithGainsVignettingAndExposures_IsWithinALevelOfDoublePrecision,
              (std::uint32_t seed)) {
  std::mt19937 random(seed);
  Calibration rig = random_rig_with_light(random);
  const Response response =
      random() % 2 == 0 ? response_of(Response::Curve::kLinear) : response_of(Response::Curve::kGamma, 1.8);
  for (HeadCalibration& head : rig.heads) head.response = response;
  const bool rgb = random() % 2 == 0;
  const std::vector<PixelFormat> formats(rig.heads.size(), rgb ? PixelFormat::kRgb24 : PixelFormat::kGrey8);
  const PixelFormat format = rgb ? PixelFormat::kRgb48 : PixelFormat::kGrey16;
  const auto layout = geometry::make_layout("equirectangular", 40, 20).value();
  table::TableOptions options;
  options.sharpen = 0;
  options.levels = 1;  // the double-precision blend has no pyramid levels
  const auto table = table::compile_blend_table(rig, *layout, format, formats, options);
  RC_PRE(table.has_value());
  std::vector<Picture> pictures;
  std::vector<ImageView> views;
  for (const HeadCalibration& head : rig.heads) {
    Picture& picture = pictures.emplace_back(formats[0], head.width, head.height);
    const double turn = static_cast<double>(random() % 628) / 100;
    const std::size_t channels = rgb ? 3 : 1;
    const auto width = static_cast<std::size_t>(head.width);
    for (std::size_t i = 0; i < picture.bytes.size(); ++i) {
      // Smooth: a 1/32 sample error of the coordinates must be far below a level.
      const double along = static_cast<double>(i / channels % width + i / channels / width) / head.width;
      picture.bytes[i] =
          static_cast<std::uint8_t>(120 + 30 * std::sin(turn + along + static_cast<double>(i % channels)));
    }
  }
  for (const Picture& picture : pictures) views.push_back(picture.view());
  const std::vector<ExposedHead> exposed(rig.heads.size(), {12 * kStop, 0});
  const blend::ToneTable tones = table::compile_tone_table(rig, format);
  const blend::SetTone tone = blend::linear_tone(*table, tones, exposed);
  Picture raymap(format, 40, 20, 77);
  blend::blend_rows(*table, PreparedHeads(*table, views).views(), tone, raymap.mutable_view(), 0, 20);
  const auto sampler = table::RaySampler::make(rig, *layout, format, formats, options).value();
  const std::vector<RealPlane> real = blend_in_double(sampler, views);
  for (std::size_t c = 0; c < real.size(); ++c) {
    for (std::size_t i = 0; i < real[c].values.size(); ++i) {
      const std::uint8_t* at = raymap.view().planes[c].data + i * static_cast<std::size_t>(rgb ? 6 : 2);
      const int number = at[0] | at[1] << 8;
      if (!real[c].covered[i]) {
        RC_ASSERT(number == 0);
        continue;
      }
      const Expected expected = expected_of(real[c].values[i], tone.output[0].scale / 256.0, sampler.power());
      RC_ASSERT(std::abs(number - expected.number) <= expected.per_level + 8);
    }
  }
}

}  // namespace
}  // namespace nodal::test
