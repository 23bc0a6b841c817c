// The exposure programs and the statistics of capture at the limits that their headers state.
#include <gtest/gtest.h>

#include <cmath>

#include "firmware/capture/exposure.h"
#include "firmware/frame/statistics.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kLit = 4;

std::array<std::optional<ExposureRange>, kMaxHeads> wide_ranges() {
  std::array<std::optional<ExposureRange>, kMaxHeads> ranges;
  for (std::size_t h = 0; h < kLit; ++h) {
    ranges[h] = {Exposure::microseconds(1), Exposure::microseconds(1'000'000), Gain(), Gain::millidecibels(24'000)};
  }
  return ranges;
}

/// Heads 0 and 1 overlap, and heads 2 and 3; each head needs the exposure in `goal`.
blend::SphereLight two_pairs(const ExposureSettings& settings, std::array<Stops, kLit> goal, Stops exposure) {
  blend::SphereLight seen;
  for (std::size_t h = 0; h < kLit; ++h) {
    seen.heads[h] = {exposure, settings.target - goal[h], 1000, 0, 0, 0};
    seen.heads[h].overlaps = head_bit(h ^ 1);
  }
  return seen;
}

/// How far the first set moves a head whose exposure is wrong by `error`.
Stops first_move(Stops error, Stops ramp) {
  ExposureSettings settings;
  settings.program = ExposureProgram::kEach;
  settings.ramp = ramp;
  ExposureControl control(settings);
  const Stops now = 10 * kStop;
  const auto orders = control.step(two_pairs(settings, {now + error, now, now, now}, now), wide_ranges());
  EXPECT_EQ(orders.heads, error == 0 ? 0u : head_bit(0)) << error;
  if (orders.heads == 0) return 0;
  return stops_of(orders.of[0].exposure) + stops_of(orders.of[0].gain) - now;
}

// The table in exposure.h; shutters are whole microseconds, so a move is exact to a few thousandths of a stop.
TEST(ExposureMoves, OfEverySizeOfError_AreThoseOfTheTable) {
  constexpr Stops kFree = 20 * kStop;
  for (const int sign : {-1, 1}) {
    for (const auto& [error, move] :
         std::vector<std::pair<Stops, Stops>>{{ExposureControl::kNear, ExposureControl::kStep},
                                              {ExposureControl::kNear + 2, (ExposureControl::kNear + 2) / 2},
                                              {kStop / 2, kStop / 4},
                                              {kStop, kStop / 2},
                                              {kStop + 8, kStop + 8},
                                              {3 * kStop, 3 * kStop}}) {
      EXPECT_NEAR(first_move(sign * error, kFree), sign * move, 4) << sign * error;
    }
    EXPECT_NEAR(first_move(sign * 3 * kStop, kStop / 4), sign * kStop / 4, 4) << "never more than the ramp";
  }
}

TEST(JointGoals, HeadsThatOverlapNoneOfTheAnchors_KeepTheirOwn) {
  ExposureSettings settings;
  settings.program = ExposureProgram::kJoint;
  settings.difference = 0;
  settings.anchor = HeadIndex{0};
  ExposureControl control(settings);
  const Stops now = 10 * kStop;
  control.step(two_pairs(settings, {now, now + 500, now + 2000, now + 2000}, now), wide_ranges());
  const auto& goal = control.report().goal;
  EXPECT_EQ(goal[0], now);
  EXPECT_EQ(goal[1], now) << "no difference between heads that overlap";
  EXPECT_EQ(goal[2], now + 2000);
  EXPECT_EQ(goal[3], now + 2000);
}

TEST(JointMoves, AHeadThatIsAbsent_IsAskedNothingAndDoesNotCount) {
  ExposureSettings settings;
  settings.program = ExposureProgram::kJoint;
  ExposureControl control(settings);
  const Stops now = 10 * kStop;
  auto ranges = wide_ranges();
  ranges[1].reset();
  const auto orders = control.step(two_pairs(settings, {now + 600, now - 3000, now + 600, now + 600}, now), ranges);
  EXPECT_EQ(orders.heads, head_bit(0) | head_bit(2) | head_bit(3));
  for (const std::size_t h : {0, 2, 3}) {
    EXPECT_NEAR(control.report().goal[h], now + 600, 1) << "the absent one's goal is in no mean";
  }
}

// Where samples are light^(1 / gamma), a factor on light is its gamma-th root on samples.
TEST(ExposedHeads, WithAGammaOfTheirOwn_AreMadeAlikeByItsRootOfTheLight) {
  blend::BlendTable table;
  table.format = PixelFormat::kGrey8;
  table.sources.resize(2);
  blend::ToneTable tones;
  tones.heads.resize(2);
  for (const auto& [gamma, ratio] : {std::pair{0, 2.0}, {1000, 2.0}, {2000, std::sqrt(2.0)}, {500, 4.0}}) {
    const std::array<blend::ExposedHead, 2> heads{{{-kStop / 2, gamma}, {kStop / 2, gamma}}};
    const blend::SetTone tone = blend::tone_of_exposures(table, tones, heads);
    const double dark = tone.heads[0].gain[0], bright = tone.heads[1].gain[0];
    EXPECT_NEAR(dark / bright, ratio, 0.01 * ratio) << gamma;
  }
}

TEST(RecentRateLimits, TwoObservationsAQuarterSecondApart_AreARate) {
  RecentRate rate;
  rate.observe(0, Instant());
  EXPECT_EQ(rate.millihertz(), 0u);
  rate.observe(10, Instant() + Duration::milliseconds(250));
  EXPECT_EQ(rate.millihertz(), 40'000u);
}

TEST(RecentRateLimits, ObservedOftener_TheWindowIsStillThreeSeconds) {
  RecentRate rate;
  Instant now;
  std::uint64_t total = 0;
  const auto pass = [&](int quarters, std::uint64_t events) {
    for (int i = 0; i < 2 * quarters; ++i) {
      rate.observe(total, now);
      now = now + Duration::milliseconds(125);
      total += events;
    }
  };
  pass(20, 4);  // 32 a second for five seconds
  EXPECT_EQ(rate.millihertz(), 32'000u);
  pass(6, 0);  // and none for one and a half
  rate.observe(total, now);
  EXPECT_EQ(rate.millihertz(), 16'000u);
}

}  // namespace
}  // namespace nodal::firmware
