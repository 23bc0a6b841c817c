#include "stitch/table/quantize.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

namespace nodal::table {
namespace {

std::array<std::uint16_t, kMaxHeads> shares(const std::vector<double>& weights) {
  std::vector<RaySample> samples;
  for (const double weight : weights) samples.push_back({static_cast<HeadIndex>(samples.size()), 1, 1, weight, 1});
  std::array<std::uint16_t, kMaxHeads> out{};
  share_out(samples, out);
  return out;
}

TEST(RoundUpTies, NumbersBelowZero_GoToTheNearestAndTiesUp) {
  EXPECT_EQ(round_up_ties(-0.2), 0);
  EXPECT_EQ(round_up_ties(-0.7), -1);
  EXPECT_EQ(round_up_ties(-1.5), -1);
  EXPECT_EQ(round_up_ties(-1.8), -2);
  EXPECT_EQ(round_up_ties(-2), -2);
  EXPECT_EQ(round_up_ties(1.5), 2);
}

TEST(ShareOut, ThirdsOfThreeHeads_SumToOneAndTheFirstGetWhatIsLeft) {
  const auto weights = shares({1.0 / 3, 1.0 / 3, 1 - 2.0 / 3});  // 32768 / 3 = 10922 and 2/3: two get one more
  EXPECT_EQ(weights[0], 10923);
  EXPECT_EQ(weights[1], 10923);
  EXPECT_EQ(weights[2], 10922);
}

TEST(ShareOut, ShareThatComesToNothing_IsNothing) {
  EXPECT_EQ(shares({1 - 1e-6, 1e-6})[0], 1 << blend::kWeightBits);
  EXPECT_EQ(shares({1 - 1e-6, 1e-6})[1], 0);
}

RC_GTEST_PROP(ShareOut, AnyWeights_SumToExactlyOneAndAreWithinOneStepOfTheirShare, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  std::vector<double> weights(1 + random() % kMaxHeads);
  for (double& weight : weights) weight = 1e-9 + static_cast<double>(random());
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
  const auto got = shares(weights);
  int total = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    total += got[k];
    RC_ASSERT(std::abs(got[k] - weights[k] * (1 << blend::kWeightBits)) <= 1.0);
  }
  RC_ASSERT(total == 1 << blend::kWeightBits);
}

TEST(QuantizeCoordinate, PlacesInThePlane_AreRoundedAndKeptWhereTheRightNeighbourIsInside) {
  EXPECT_EQ(quantize_coordinate(10.25, 64), 10 * 4096 + 1024);
  EXPECT_EQ(quantize_coordinate(10.99995, 64), 11 * 4096);  // nearer to 11 than to 10 + 4095/4096
  EXPECT_EQ(quantize_coordinate(63, 64), 63 * 4096 - 1);    // the last, as near as its left neighbour can represent it
  EXPECT_EQ(quantize_coordinate(0, 64), 0);
}

TEST(QuantizeCoordinate, ValueBetweenTwoSteps_GoesUpWhateverItsLastBits) {
  const double tie = 20 + 10.5 / 4096;
  for (const double noise : {-4e-15, 0.0, 4e-15}) EXPECT_EQ(quantize_coordinate(tie + noise, 64), 20 * 4096 + 11);
  EXPECT_EQ(quantize_gain(1 + 0.5 / 4096 - 1e-15), quantize_gain(1 + 0.5 / 4096 + 1e-15));
}

TEST(QuantizeGain, Gains_AreRoundedAndKeptInRange) {
  EXPECT_EQ(quantize_gain(1), 4096);
  EXPECT_EQ(quantize_gain(1.4), 5734);
  EXPECT_EQ(quantize_gain(0), 1);
  EXPECT_EQ(quantize_gain(1e30), blend::kMaxGain);
}

}  // namespace
}  // namespace nodal::table
