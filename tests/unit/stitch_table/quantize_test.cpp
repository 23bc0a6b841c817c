#include "stitch/table/quantize.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>

#include "rigs.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::table {
namespace {

/// Heads of 64 x 48, all formats GREY; only the plane's size matters here.
class AppendTaps : public testing::Test {
 protected:
  static std::vector<blend::Tap> taps_of(const std::vector<RaySample>& samples) {
    static const auto layout = geometry::make_layout("equirectangular", 16, 8).value();
    static const RaySampler sampler = [] {
      Calibration rig;
      rig.name = "quantize";
      for (int h = 0; h < kMaxHeads; ++h) {
        rig.heads.push_back(test::head_at("h" + std::to_string(h), 64, 48, TsaiLens{50, 0, 0}, {h * 20.0, 0, 0}));
      }
      const std::vector<PixelFormat> formats(kMaxHeads, PixelFormat::kGrey8);
      return RaySampler::make(rig, *layout, PixelFormat::kGrey8, formats, {}).value();
    }();
    std::vector<blend::Tap> taps;
    append_taps(samples, sampler, 0, taps);
    return taps;
  }
};

TEST_F(AppendTaps, ThirdsOfThreeHeads_SumToOneAndTheFirstGetWhatIsLeft) {
  const auto taps = taps_of({{3, 1, 1, 1.0 / 3, 1}, {5, 1, 1, 1.0 / 3, 1}, {9, 1, 1, 1 - 2.0 / 3, 1}});
  ASSERT_EQ(taps.size(), 3U);  // 32768 / 3 = 10922 and 2/3: two of them get one more
  EXPECT_EQ(taps[0].weight, 10923);
  EXPECT_EQ(taps[1].weight, 10923);
  EXPECT_EQ(taps[2].weight, 10922);
}

TEST_F(AppendTaps, ShareThatComesToNothing_IsLeftOut) {
  const auto taps = taps_of({{0, 1, 1, 1 - 1e-6, 1}, {1, 1, 1, 1e-6, 1}});
  ASSERT_EQ(taps.size(), 1U);
  EXPECT_EQ(taps[0].weight, 1 << blend::kWeightBits);
}

TEST_F(AppendTaps, Coordinates_AreRoundedAndKeptWhereTheRightNeighbourIsInside) {
  const auto tap = [&](double x, double y) { return taps_of({{0, x, y, 1, 1}}).at(0); };
  EXPECT_EQ(tap(10.25, 0).x, 10);
  EXPECT_EQ(tap(10.25, 0).fraction_x, 1024);
  EXPECT_EQ(tap(10.99995, 0).x, 11);  // nearer to 11 than to 10 + 4095/4096
  EXPECT_EQ(tap(10.99995, 0).fraction_x, 0);
  EXPECT_EQ(tap(63, 47).x, 62);  // the last sample, as nearly as its left neighbour can say it
  EXPECT_EQ(tap(63, 47).fraction_x, 4095);
  EXPECT_EQ(tap(63, 47).y, 46);
  EXPECT_EQ(tap(63, 47).fraction_y, 4095);
}

TEST_F(AppendTaps, ValueBetweenTwoSteps_GoesUpWhateverItsLastBits) {
  const double tie = 20 + 10.5 / 4096;
  for (const double noise : {-4e-15, 0.0, 4e-15}) {
    EXPECT_EQ(taps_of({{0, tie + noise, 0, 1, 1}}).at(0).fraction_x, 11);
  }
  EXPECT_EQ(quantize_gain(1 + 0.5 / 4096 - 1e-15), quantize_gain(1 + 0.5 / 4096 + 1e-15));
}

TEST_F(AppendTaps, Gains_AreRoundedAndKeptInRange) {
  EXPECT_EQ(quantize_gain(1), 4096);
  EXPECT_EQ(quantize_gain(1.4), 5734);
  EXPECT_EQ(quantize_gain(0), 1);
  EXPECT_EQ(quantize_gain(1e30), blend::kMaxGain);
}

RC_GTEST_FIXTURE_PROP(AppendTaps, AnyWeights_SumToExactlyOneAndAreWithinOneStepOfTheirShare, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  std::vector<RaySample> samples(1 + random() % kMaxHeads);
  double sum = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    samples[k] = {static_cast<HeadIndex>(k), 1, 1, 1e-9 + static_cast<double>(random()), 1};
    sum += samples[k].weight;
  }
  for (RaySample& sample : samples) sample.weight /= sum;
  int total = 0;
  for (const blend::Tap& tap : taps_of(samples)) {
    total += tap.weight;
    RC_ASSERT(std::abs(tap.weight - samples[tap.head].weight * (1 << blend::kWeightBits)) <= 1.0);
  }
  RC_ASSERT(total == 1 << blend::kWeightBits);
}

}  // namespace
}  // namespace nodal::table
