// The blend against answers worked out on paper.
#include <gtest/gtest.h>

#include "small_tables.h"

namespace nodal::blend::test {
namespace {

/// Two by two heads of one grey row each, blended into a row.
std::vector<std::uint8_t> blend_grey(const BlendTable& table, const std::vector<ImageView>& heads) {
  Picture raymap(PixelFormat::kGrey8, table.width, table.height, 77);
  blend_rows(table, heads, raymap.mutable_view(), 0, table.height);
  return raymap.bytes;
}

Picture grey2x2(std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
  Picture picture(PixelFormat::kGrey8, 2, 2);
  picture.bytes = {a, b, c, d};
  return picture;
}

TEST(BlendRows, FractionsOfOneTap_MixTheFourSamplesBilinearly) {
  const Picture head = grey2x2(0, 100, 200, 40);
  const std::uint16_t quarter = kHalf / 2;
  const BlendTable table = grey_row({{{0, 0, 0, 0, kOneWeight, kOneGain, 0, 0}},
                                     {{0, 0, kHalf, 0, kOneWeight, kOneGain, 0, 0}},
                                     {{0, 0, 0, kHalf, kOneWeight, kOneGain, 0, 0}},
                                     {{0, 0, kHalf, kHalf, kOneWeight, kOneGain, 0, 0}},
                                     {{0, 0, quarter, kHalf, kOneWeight, kOneGain, 0, 0}}},
                                    1, 2, 2);
  // Last: top 25, bottom 160, half way 92.5, and halves go up.
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{0, 50, 100, 85, 93}));
}

TEST(BlendRows, WeightsOfTwoHeads_GiveTheWeightedMean) {
  const Picture dark = grey2x2(40, 40, 40, 40);
  const Picture light = grey2x2(200, 200, 200, 200);
  const BlendTable table = grey_row({{{0, 0, 0, 0, 8192, kOneGain, 0, 0}, {0, 0, 0, 0, 24576, kOneGain, 1, 0}},
                                     {{0, 0, 0, 0, 32767, kOneGain, 0, 0}, {0, 0, 0, 0, 1, kOneGain, 1, 0}}},
                                    2, 2, 2);
  EXPECT_EQ(blend_grey(table, {dark.view(), light.view()}), (std::vector<std::uint8_t>{160, 40}));
}

TEST(BlendRows, GainOfTapAndHead_MultiplyAboutBlackAndClamp) {
  const Picture head = grey2x2(60, 60, 60, 60);
  BlendTable table = grey_row({{{0, 0, 0, 0, kOneWeight, kOneGain * 2, 0, 0}},
                               {{0, 0, 0, 0, kOneWeight, kMaxGain, 0, 0}},
                               {{0, 0, 0, 0, kOneWeight, kOneGain / 2, 0, 0}}},
                              1, 2, 2);
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{120, 255, 30}));
  table.sources[0].gain = {kOneGain / 2, 1, 1};  // grey uses gain_row 0
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{60, 240, 15}));
  table.components[0].black = 16;  // 16 + 44 * 1, 16 + 44 * 4 (a hair less), 16 + 44 / 4
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{60, 192, 27}));
  const Picture below_black = grey2x2(0, 0, 0, 0);  // 16 - 16 * 4 is under what a byte holds
  EXPECT_EQ(blend_grey(table, {below_black.view()})[1], 0);
}

TEST(BlendRows, SampleWithoutTaps_IsTheComponentsBlack) {
  BlendTable table = grey_row({{}}, 1, 2, 2);
  const Picture head = grey2x2(255, 255, 255, 255);
  EXPECT_EQ(blend_grey(table, {head.view()})[0], 0);
  table.components[0].black = 16;
  EXPECT_EQ(blend_grey(table, {head.view()})[0], 16);
}

TEST(BlendRows, HeadMissing_OthersTakeItsShareExactly) {
  const Picture a = grey2x2(10, 10, 10, 10);
  const Picture b = grey2x2(31, 31, 31, 31);
  const BlendTable table = grey_row({{{0, 0, 0, 0, 16384, kOneGain, 0, 0},
                                      {0, 0, 0, 0, 10923, kOneGain, 1, 0},
                                      {0, 0, 0, 0, 5461, kOneGain, 2, 0}},
                                     {{0, 0, 0, 0, kOneWeight, kOneGain, 0, 0}}},
                                    3, 2, 2);
  // Head 0 gone: (10 * 10923 + 31 * 5461) / 16384 = 16.9998; and what it alone saw is black.
  EXPECT_EQ(blend_grey(table, {ImageView{}, a.view(), b.view()}), (std::vector<std::uint8_t>{17, 0}));
  EXPECT_EQ(blend_grey(table, {ImageView{}, ImageView{}, ImageView{}}), (std::vector<std::uint8_t>{0, 0}));
}

TEST(BlendRows, RgbGains_ActOnTheirOwnColour) {
  Picture head(PixelFormat::kRgb24, 2, 2, 100);
  BlendTable table = grey_row({{{0, 0, kHalf, kHalf, kOneWeight, kOneGain, 0, 0}}}, 1, 2, 2);
  table.format = PixelFormat::kRgb24;
  table.sources[0] = {PixelFormat::kRgb24, 2, 2, {kOneGain, kOneGain * 2, kOneGain / 4}};
  table.components = {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
  Picture raymap(PixelFormat::kRgb24, 1, 1);
  blend_rows(table, std::vector{head.view()}, raymap.mutable_view(), 0, 1);
  EXPECT_EQ(raymap.bytes, (std::vector<std::uint8_t>{100, 200, 25}));
}

TEST(BlendRows, Sharpening_AddsTheDifferenceFromFourNeighboursAndRepeatsTheEdge) {
  Picture head(PixelFormat::kGrey8, 3, 3, 100);
  head.bytes[4] = 140;  // in the middle
  BlendTable table = grey_row({{{1, 1, 0, 0, kOneWeight, kOneGain, 0, 0}},   // the middle: 140 + 4 * 40 * 4 / 64
                               {{0, 1, 0, 0, kOneWeight, kOneGain, 0, 0}},   // beside it: 100 - 40 * 4 / 64 = 97.5
                               {{0, 0, 0, 0, kOneWeight, kOneGain, 0, 0}},   // a corner, which it does not touch
                               {{0, 1, kHalf, 0, kOneWeight, kOneGain, 0, 0}}},  // (98 + 150) / 2
                              1, 3, 3);
  table.sources[0].sharpen = 4;
  EXPECT_EQ(blend_grey(table, {head.view()}), (std::vector<std::uint8_t>{150, 98, 100, 124}));
  head.bytes[4] = 255;
  table.sources[0].sharpen = 16;  // 255 + 4 * 155 / 4 is more than white
  EXPECT_EQ(blend_grey(table, {head.view()})[0], 255);
}

TEST(ValidityRows, ShareOfTheWeightThatIsThere_IsToldWithoutCallingLittleNothing) {
  const Picture head = grey2x2(0, 0, 0, 0);
  const BlendTable table = grey_row({{{0, 0, 0, 0, kOneWeight, kOneGain, 1, 0}},
                                     {{0, 0, 0, 0, 16384, kOneGain, 0, 0}, {0, 0, 0, 0, 16384, kOneGain, 1, 0}},
                                     {{0, 0, 0, 0, 32767, kOneGain, 0, 0}, {0, 0, 0, 0, 1, kOneGain, 1, 0}},
                                     {{0, 0, 0, 0, 1, kOneGain, 0, 0}, {0, 0, 0, 0, 32767, kOneGain, 1, 0}},
                                     {}},
                                    2, 2, 2);
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
