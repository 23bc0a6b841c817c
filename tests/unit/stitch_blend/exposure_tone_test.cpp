// The tones of sets whose heads have different exposures, against the formulas of their headers in real numbers.
#include "stitch/blend/exposure_tone.h"

#include <gtest/gtest.h>

#include <cmath>

#include "small_tables.h"
#include "stitch/blend/linear_tone.h"

namespace nodal::blend::test {
namespace {

/// soften(): straight up to 70 % of `full`, then Reinhard's extended curve up to `top`.
double softened(double value, double top, double full) {
  const double from = 0.7 * full;
  if (value <= from) return value;
  const double t = (std::min(value, top) - from) / (full - from);
  const double most = (top - from) / (full - from);
  return from + (full - from) * t * (1 + t / (most * most)) / (1 + t);
}

BlendTable two_grey_heads() { return grey_row({{{0, 0, 0}}, {{1, 0, 0}}}, 2, 2); }

ToneTable values_that_are_light() {
  ToneTable tones;
  tones.heads.resize(2);
  for (std::uint64_t level = 0; level < ToneTable::kShownLevels; ++level)
    tones.shown_light.push_back(static_cast<std::uint32_t>(level * ToneTable::kWhite / 255));
  return tones;
}

std::array<ExposedHead, 2> two_stops_apart(std::int32_t gamma) { return {{{10 * kStop, gamma}, {12 * kStop, gamma}}}; }

TEST(ToneOfExposures, LiftedLight_IsCompressedSoThatAllOfItIsShown) {
  const SetTone tone = tone_of_exposures(two_grey_heads(), values_that_are_light(), two_stops_apart(0));
  ASSERT_TRUE(tone.output[0].curve);
  const double top = 2.0 * kMaxSample;  // the darker head is a stop below the mean
  for (std::size_t i = 0; i < tone.output[0].curve->knots.size(); ++i) {
    const double lifted = 512.0 * static_cast<double>(i) * tone.output[0].scale / kScaleOne;
    EXPECT_NEAR(tone.output[0].curve->knots[i], softened(lifted, top, kMaxSample), 2) << "knot " << i;
  }
}

TEST(ToneOfExposures, HeadsWithAGamma_HaveGainsThatArePowersOfTheirExposures) {
  for (const auto& [gamma, stops] : {std::pair{0, 2.0}, {1000, 2.0}, {2000, 1.0}, {500, 4.0}}) {
    const SetTone tone = tone_of_exposures(two_grey_heads(), values_that_are_light(), two_stops_apart(gamma));
    const double ratio = static_cast<double>(tone.heads[0].gain[0]) / tone.heads[1].gain[0];
    EXPECT_NEAR(std::log2(ratio), stops, 0.002) << "gamma " << gamma;
  }
}

TEST(LinearScaleOfExposures, ALevelBegins_AtTheLeastLightThatIsCompressedToIt) {
  const ToneTable tones = values_that_are_light();
  const auto heads = two_stops_apart(0);
  const LinearScale scale = linear_scale(tones, linear_tone(two_grey_heads(), tones, heads), heads);
  EXPECT_EQ(scale.full, 10 * kStop);
  const auto top = static_cast<std::int64_t>(kMaxSample * std::exp2(465.0 / 1024));  // a stop of light in gamma 2.2
  for (std::int64_t level = 1; level < 256; ++level) {
    const std::int64_t begin = level * 128 - 64;
    std::int64_t sample = begin;
    while (soften(sample, top, kMaxSample) < begin) ++sample;
    // White is the light that fills a sample of a head with the mean exposure, a stop above the darker head's.
    EXPECT_NEAR(scale.shown_from[static_cast<std::size_t>(level)],
                std::ceil(65535 / 2.0 * static_cast<double>(sample) / kMaxSample), 1)
        << "level " << level;
  }
}

}  // namespace
}  // namespace nodal::blend::test
