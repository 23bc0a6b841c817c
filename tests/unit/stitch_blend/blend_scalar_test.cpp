// The blend against results calculated by hand.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include "small_tables.h"

namespace nodal::blend::test {
namespace {

std::vector<std::uint8_t> blend_grey(const BlendTable& table, const std::vector<ImageView>& heads,
                                     const SetTone& tone) {
  Picture raymap(PixelFormat::kGrey8, table.width, table.height, 77);
  blend_rows_by(Kernel::kScalar, table, heads, tone, raymap.mutable_view(), 0, table.height);
  return raymap.bytes;
}
std::vector<std::uint8_t> blend_grey(const BlendTable& table, const std::vector<ImageView>& heads) {
  return blend_grey(table, heads, calibrated_tone(table));
}

Picture grey2x2(std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
  Picture picture(PixelFormat::kGrey8, 2, 2);
  picture.bytes = {a, b, c, d};
  return picture;
}
Picture flat(std::uint8_t level) { return grey2x2(level, level, level, level); }

constexpr int kHalf = kOnePixel / 2;

/// The identity curve: each sample maps to itself.
template <class Curve>
Curve straight() {
  Curve curve;
  const auto step = 32768 / (static_cast<int>(curve.knots.size()) - 1);
  for (std::size_t i = 0; i < curve.knots.size(); ++i) {
    curve.knots[i] =
        static_cast<typename decltype(curve.knots)::value_type>(std::min(static_cast<int>(i) * step, kMaxSample));
  }
  return curve;
}

TEST(BlendRows, FractionsOfOneLook_MixTheFourSamplesBilinearly) {
  const Picture head = grey2x2(0, 100, 200, 40);
  const BlendTable table =
      grey_row({{{0, 0, 0}}, {{0, kHalf, 0}}, {{0, 0, kHalf}}, {{0, kHalf, kHalf}}, {{0, kHalf / 2, kHalf}}}, 1, 2);
  // The first pixel is the sample itself. The last: top 25, bottom 160, half way 92.5, rounded up.
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{0, 50, 100, 85, 93}));
}

TEST(BlendRows, WeightsOfTwoHeads_GiveTheWeightedMean) {
  const BlendTable table = grey_row({{{0, 0, 0, 8192}, {1, 0, 0, 24576}}, {{0, 0, 0, 32767}, {1, 0, 0, 1}}}, 2, 2);
  EXPECT_EQ(blend_grey(table, {flat(40).view(), flat(200).view()}), (std::vector<std::uint8_t>{160, 40}));
}

TEST(BlendRows, VignettingAndHeadGain_MultiplyAboutBlackAndClamp) {
  BlendTable table = grey_row({{{0, 0, 0}}, {{0, 0, 0}}, {{0, 0, 0}}}, 1, 2);
  table.vignetting_scale = 1024;                 // gains are in quarters of 8192
  table.grids[0].gains = {{16384, 8160, 0, 0}};  // 2, then slightly less than 3 and 4
  EXPECT_EQ(blend_grey(table, {flat(60).view()}), (std::vector<std::uint8_t>{120, 180, 240}));
  table.sources[0].gain[0] = kOneGain / 2;
  EXPECT_EQ(blend_grey(table, {flat(60).view()}), (std::vector<std::uint8_t>{60, 90, 120}));
  table.sources[0].gain[0] = kOneGain * 4;
  EXPECT_EQ(blend_grey(table, {flat(60).view()}), (std::vector<std::uint8_t>{255, 255, 255}));
  table.sources[0].gain[0] = kOneGain;
  table.components[0].black = 16;  // 16 + 44 * 2, 16 + 44 * 3, 16 + 44 * 4
  EXPECT_EQ(blend_grey(table, {flat(60).view()}), (std::vector<std::uint8_t>{104, 148, 192}));
  EXPECT_EQ(blend_grey(table, {flat(0).view()})[2], 0);  // 16 - 16 * 4 is below 0
}

TEST(BlendRows, PixelNobodyLooksAt_IsTheComponentsBlack) {
  BlendTable table = grey_row({{}, {{0, 0, 0}}}, 1, 2);
  EXPECT_EQ(blend_grey(table, {flat(255).view()}), (std::vector<std::uint8_t>{0, 255}));
  table.components[0].black = 16;
  EXPECT_EQ(blend_grey(table, {flat(255).view()}), (std::vector<std::uint8_t>{16, 255}));
}

TEST(BlendRows, PixelsWithoutWeightThatLookAnywhere_ReadNothingBesideThePicture) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  void* const pages = mmap(nullptr, 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  std::uint8_t* const end = static_cast<std::uint8_t*>(pages) + page;  // what follows the picture cannot be read
  ASSERT_EQ(mprotect(end, page, PROT_NONE), 0);
  std::fill(end - 4, end, std::uint8_t{100});
  const ImageView picture = packed_image(PixelFormat::kGrey8, 2, 2, static_cast<const std::uint8_t*>(end - 4));
  constexpr int kFar = 15 * kOnePixel;
  const BlendTable table = grey_row({{{0, 0, 0}}, {{0, kFar, 0, 0}}, {{0, 0, kFar, 0}}, {{0, kFar, kFar, 0}}}, 1, 2);
  EXPECT_EQ(blend_grey(table, {picture}), (std::vector<std::uint8_t>{100, 0, 0, 0}));
  munmap(pages, 2 * page);
}

TEST(BlendRows, HeadMissing_OthersTakeItsShare) {
  const Picture a = flat(10);
  const Picture b = flat(31);
  const BlendTable table = grey_row({{{0, 0, 0, 16384}, {1, 0, 0, 10923}, {2, 0, 0, 5461}}, {{0, 0, 0}}}, 3, 2);
  // Head 0 is missing: (10 * 10923 + 31 * 5461) / 16384 = 16.9998; pixels that only head 0 sees are black.
  EXPECT_EQ(blend_grey(table, {ImageView{}, a.view(), b.view()}), (std::vector<std::uint8_t>{17, 0}));
  EXPECT_EQ(blend_grey(table, {ImageView{}, ImageView{}, ImageView{}}), (std::vector<std::uint8_t>{0, 0}));
}

TEST(BlendRows, RgbGains_ActOnTheirOwnColour) {
  Picture head(PixelFormat::kRgb24, 2, 2, 100);
  BlendTable table = grey_row({{{0, kHalf, kHalf}}}, 1, 2);
  table.format = PixelFormat::kRgb24;
  table.sources[0] = {PixelFormat::kRgb24, 2, 2, {kOneGain, kOneGain * 2, kOneGain / 4}};
  table.components = {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
  Picture raymap(PixelFormat::kRgb24, 1, 1);
  blend_rows(table, std::vector{head.view()}, calibrated_tone(table), raymap.mutable_view(), 0, 1);
  EXPECT_EQ(raymap.bytes, (std::vector<std::uint8_t>{100, 200, 25}));
}

TEST(BlendRows, CurveOfOneHead_BendsItsSamplesAlone) {
  const BlendTable table = grey_row({{{0, 0, 0}}, {{1, 0, 0}}}, 2, 2);
  SetTone tone = calibrated_tone(table);
  tone.heads[1].curve[0] = straight<ToneCurve>();
  EXPECT_EQ(blend_grey(table, {flat(50).view(), flat(50).view()}, tone), (std::vector<std::uint8_t>{50, 50}));
  for (std::size_t i = 0; i < 33; ++i) tone.heads[1].curve[0]->knots[i] = static_cast<std::int16_t>(i * i * 30);
  // Level 50 is sample 6400, a quarter of the way from knot 6 to 7: 1080 + 390 / 4 = 1177.5, or 9.2 levels.
  EXPECT_EQ(blend_grey(table, {flat(50).view(), flat(50).view()}, tone), (std::vector<std::uint8_t>{50, 9}));
}

TEST(BlendRows, OutputCurve_TakesThePlaceOfTheScale) {
  const BlendTable table = grey_row({{{0, 0, 0}}}, 1, 2);
  SetTone tone = calibrated_tone(table);
  tone.output[0].scale = 512;
  EXPECT_EQ(blend_grey(table, {flat(60).view()}, tone)[0], 120);
  tone.output[0].curve = straight<OutputCurve>();
  EXPECT_EQ(blend_grey(table, {flat(60).view()}, tone)[0], 60);
  tone.output[0].curve->knots[15] = 0;  // level 60 is light 7680, knot 15
  EXPECT_EQ(blend_grey(table, {flat(60).view()}, tone)[0], 0);
  EXPECT_EQ(blend_grey(table, {flat(62).view()}, tone)[0], 32);  // half way to knot 16, 64 levels
}

TEST(BlendRows, HeadThatIsClipped_YieldsToOneThatIsNot) {
  const BlendTable table = grey_row({{{0, 0, 0, 16384}, {1, 0, 0, 16384}}, {{0, 0, 0}}}, 2, 2);
  SetTone tone = calibrated_tone(table);
  tone.confidence.emplace();
  for (auto& head : tone.confidence->of_level) head.fill(255);
  EXPECT_EQ(blend_grey(table, {flat(255).view(), flat(100).view()}, tone), (std::vector<std::uint8_t>{178, 255}));
  for (auto& head : tone.confidence->of_level) head[255] = 5;  // (255 * 5 + 100 * 255) / 260 = 102.98
  EXPECT_EQ(blend_grey(table, {flat(255).view(), flat(100).view()}, tone), (std::vector<std::uint8_t>{103, 255}));
  for (auto& head : tone.confidence->of_level) head[255] = 0;
  EXPECT_EQ(blend_grey(table, {flat(255).view(), flat(100).view()}, tone), (std::vector<std::uint8_t>{100, 0}));
}

TEST(ToneOfGains, LargestGain_SetsTheScaleAndTheRestIsLowered) {
  BlendTable table = grey_row({{{0, 0, 0}}, {{1, 0, 0}}}, 2, 2);
  EXPECT_FALSE(calibrated_tone(table).gains);
  EXPECT_EQ(calibrated_tone(table).output[0].scale, kScaleOne);
  const std::array<std::array<std::uint16_t, 3>, 2> gains{
      {{kOneGain * 4, kOneGain, kOneGain}, {kOneGain, 1, kOneGain}}};
  const SetTone tone = tone_of_gains(table, gains);
  EXPECT_TRUE(tone.gains);
  EXPECT_EQ(tone.output[0].scale, 4 * kScaleOne);
  EXPECT_EQ(tone.heads[0].gain[0], kMaxToneGain);
  EXPECT_EQ(tone.heads[1].gain[0], 8192);
  EXPECT_EQ(tone.heads[1].gain[1], 2);
  table.vignetting_scale = 512;
  EXPECT_EQ(tone_of_gains(table, gains).output[0].scale, 8 * kScaleOne);
}

TEST(ValidityRows, ShareOfTheWeightThatIsThere_IsToldWithoutCallingLittleNothing) {
  const Picture head = flat(0);
  const BlendTable table = grey_row({{{1, 0, 0}},
                                     {{0, 0, 0, 16384}, {1, 0, 0, 16384}},
                                     {{0, 0, 0, 32767}, {1, 0, 0, 1}},
                                     {{0, 0, 0, 1}, {1, 0, 0, 32767}},
                                     {}},
                                    2, 2);
  const auto validity = [&](const std::vector<ImageView>& heads) {
    Picture mask(PixelFormat::kGrey8, table.width, 1, 77);
    validity_rows(table, heads, mask.mutable_view().planes[0], 0, 1);
    return mask.bytes;
  };
  EXPECT_EQ(validity({head.view(), head.view()}), (std::vector<std::uint8_t>{255, 255, 255, 255, 0}));
  EXPECT_EQ(validity({ImageView{}, head.view()}), (std::vector<std::uint8_t>{255, 127, 1, 254, 0}));
  EXPECT_EQ(validity({ImageView{}, ImageView{}}), (std::vector<std::uint8_t>{0, 0, 0, 0, 0}));
}

}  // namespace
}  // namespace nodal::blend::test
