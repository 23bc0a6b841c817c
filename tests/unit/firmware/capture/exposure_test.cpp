#include "firmware/capture/exposure.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

namespace nodal::firmware {
namespace {

ExposureRange range() {
  return {Exposure::microseconds(10), Exposure::microseconds(16'000), Gain::millidecibels(0),
          Gain::millidecibels(24'000)};
}

RC_GTEST_PROP(SplitExposure, AnyStopsWithinReach_LetThroughThatMuchAndShuttersGoBeforeGain, ()) {
  const auto [low, high] = reach(range());
  const Stops wanted = *rc::gen::inRange(low, high + 1);
  const ExposureOrder order = split(wanted, range());
  const double light = std::log2(static_cast<double>(order.exposure.us())) + order.gain.mdb() / 6020.6;
  RC_ASSERT(std::abs(light - wanted / 1024.0) < 3.0 / 1024);
  RC_ASSERT(order.gain >= range().lowest && order.gain <= range().highest);
  // If the shutter could be a microsecond longer, the gain must be less than the equivalent of that.
  if (order.exposure < range().longest) {
    RC_ASSERT(order.gain.mdb() <= 6100 * std::log2(1 + 1.0 / static_cast<double>(order.exposure.us())) + 10);
  }
}

/// A chain of four heads, each overlapping the next, that measure the given light.
blend::SphereLight chain(std::array<Stops, 4> light, Stops exposure) {
  blend::SphereLight seen;
  for (std::size_t h = 0; h < 4; ++h) {
    seen.heads[h] = {exposure, light[h], 1000, 0, 0, 0};
    if (h > 0) seen.heads[h].overlaps |= head_bit(h - 1);
    if (h < 3) seen.heads[h].overlaps |= head_bit(h + 1);
  }
  return seen;
}

std::array<std::optional<ExposureRange>, kMaxHeads> four() {
  std::array<std::optional<ExposureRange>, kMaxHeads> ranges;
  for (std::size_t h = 0; h < 4; ++h) ranges[h] = range();
  return ranges;
}

TEST(JointExposure, AnAnchorThatNoRigCanHave_IsAnAssertion) {
  ExposureSettings settings;
  settings.anchor = static_cast<HeadIndex>(kMaxHeads - 1);
  ExposureControl control(settings);
  settings.anchor = static_cast<HeadIndex>(kMaxHeads);
  EXPECT_DEATH(control.set(settings), "anchor");
}

RC_GTEST_PROP(JointExposure, AnyLight_NeighboursStayWithinTheDifferenceAndTheMeanIsKept, ()) {
  ExposureSettings settings;
  settings.program = ExposureProgram::kJoint;
  settings.difference = *rc::gen::inRange(0, 3 * kStop);
  const bool anchored = *rc::gen::arbitrary<bool>();
  if (anchored) settings.anchor = static_cast<HeadIndex>(*rc::gen::inRange(0, 4));
  std::array<Stops, 4> light{};
  for (Stops& each : light) each = -12 * kStop + *rc::gen::inRange(-2 * kStop, 2 * kStop);
  ExposureControl control(settings);
  control.step(chain(light, 10 * kStop), four());
  const auto& goal = control.report().goal;
  double mean = 0;
  double alone = 0;
  for (std::size_t h = 0; h < 4; ++h) {
    if (h > 0) RC_ASSERT(std::abs(goal[h] - goal[h - 1]) <= settings.difference + 1);
    mean += goal[h] / 4.0;
    alone += (settings.target - light[h]) / 4.0;
  }
  if (anchored) {
    RC_ASSERT(goal[*settings.anchor] == settings.target - light[*settings.anchor]);
  } else {
    RC_ASSERT(std::abs(mean - alone) <= 2);
  }
}

TEST(ExposureControl, ManualOrLocked_NothingIsAsked) {
  for (const bool locked : {false, true}) {
    ExposureSettings settings;
    settings.program = locked ? ExposureProgram::kEach : ExposureProgram::kManual;
    settings.locked = locked;
    ExposureControl control(settings);
    EXPECT_EQ(control.step(chain({-3000, -9000, -9000, -9000}, 10 * kStop), four()).heads, 0U);
  }
}

TEST(ExposureControl, NearItsGoal_MovesByStepsThatAreNotSeenAndThenRests) {
  ExposureSettings settings;
  settings.program = ExposureProgram::kEach;
  ExposureControl control(settings);
  const Stops light = settings.target - 10 * kStop;  // exactly as exposed at 10
  const auto at = [&](Stops off) { return chain({light - off, light, light, light}, 10 * kStop); };
  Stops moved = 0;
  Stops before = 10 * kStop;
  for (int set = 0; set < 12; ++set) {
    const auto orders = control.step(at(kStop / 8), four());
    if ((orders.heads & 1) == 0) continue;
    const Stops now = stops_of(orders.of[0].exposure) + stops_of(orders.of[0].gain);
    EXPECT_LE(now - before, ExposureControl::kStep + 4);
    moved += now - before;
    before = now;
  }
  EXPECT_NEAR(moved, kStop / 8, ExposureControl::kStep);
  EXPECT_EQ(control.step(at(kStop / 8 + kStop / 32), four()).heads, 0U) << "noise moves nothing";
}

}  // namespace
}  // namespace nodal::firmware
