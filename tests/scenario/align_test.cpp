// A rig without a trigger: free-running heads are brought into step and kept in step.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <vector>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::GenlockState;

constexpr Duration kPeriod = FrameRate{}.period();
constexpr std::array<std::int32_t, kHeads> kDrifts = {50, -50, 31, -17, 8, -44};

/// Heads with crystal errors of up to 50 ppm and random phases.
StandOptions free_rig(Duration stamp_jitter = {},
                      const std::function<void(HeadIndex, hal::sim::HeadOptions&)>& also = {}) {
  StandOptions options;
  options.config.trigger.source = firmware::SyncSource::kNone;
  options.config.trigger.start = true;
  options.world.adjust = [=](HeadIndex i, hal::sim::HeadOptions& head) {
    head.free_run_drift_ppm = kDrifts[i];
    head.stamp_jitter = stamp_jitter;
    if (also) also(i, head);
  };
  return options;
}

/// For the newest exposures, the true latest minus the earliest middle, each reduced by whole periods.
Duration true_spread(Stand& stand) {
  std::optional<Instant> first;
  Duration least, most;
  for (int i = 0; i < kHeads; ++i) {
    const auto& head = stand.world.head(i);
    const auto truth = head.truth_of(static_cast<std::uint32_t>(head.counts().exposed - 1));
    if (!first) first = truth->mid_exposure;
    std::int64_t apart = (truth->mid_exposure - *first).ns() % kPeriod.ns();
    if (apart > kPeriod.ns() / 2) apart -= kPeriod.ns();
    if (apart < -kPeriod.ns() / 2) apart += kPeriod.ns();
    least = std::min(least, Duration::nanoseconds(apart));
    most = std::max(most, Duration::nanoseconds(apart));
  }
  return most - least;
}

bool locks(Stand& stand, Duration within = Duration::seconds(5)) {
  return stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, within);
}

TEST(Align, CrystalsOffBy50ppmAndStampsBy200us_InStepWithinThreeSecondsAndHeldThere) {
  Stand stand(free_rig(Duration::microseconds(200)));
  const Instant begun = stand.world.clock().now();
  ASSERT_TRUE(locks(stand, Duration::seconds(3)));
  const Duration took = stand.world.clock().now() - begun;
  Duration worst;
  std::vector<std::int64_t> held;
  int not_locked = 0;
  for (int i = 0; i < 900; ++i) {
    stand.run(kPeriod);
    if (stand.capture().genlock.state != GenlockState::kLocked) {
      ++not_locked;
      continue;
    }
    held.push_back(true_spread(stand).us());
    worst = std::max(worst, true_spread(stand));
  }
  std::sort(held.begin(), held.end());
  std::cout << "in step " << took.ms() << " ms after the start; held to " << held[held.size() / 2] << " us (median), "
            << worst.us() << " us (worst) over 30 s; not locked for " << not_locked << " of 900 periods\n";
  EXPECT_LE(worst, Duration::microseconds(500));
  EXPECT_LE(held[held.size() / 2], 120);
  EXPECT_GE(held[held.size() / 2], 1) << "nothing holds heads so well";
  EXPECT_LE(not_locked, 45);
}

TEST(Align, StampsThatDoNotJitter_HeldToATenthOfAMillisecondByFewNudges) {
  Stand stand(free_rig());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(locks(stand));
  stand.run(Duration::seconds(10));
  Duration worst;
  for (int i = 0; i < 300; ++i) {
    stand.run(kPeriod);
    worst = std::max(worst, true_spread(stand));
  }
  EXPECT_LE(worst, Duration::microseconds(150));
  const wire::Genlock now = host.status().genlock();
  EXPECT_EQ(now.state(), "locked");
  EXPECT_EQ(now.losses(), 0u);
  EXPECT_TRUE(now.aligned());
  EXPECT_EQ(now.unaligned_size(), 0);
  for (int i = 0; i < kHeads; ++i) {
    EXPECT_NEAR(host.heads().heads(i).drift_ppb(), kDrifts[static_cast<std::size_t>(i)] * 1000, 500) << i;
  }
}

TEST(Align, AHeadThatCannotBeMoved_TheOthersComeToIt) {
  Stand stand(free_rig({}, [](HeadIndex i, hal::sim::HeadOptions& head) {
    if (i == 3) head.limits.nudge = {};
  }));
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(locks(stand));
  stand.run(Duration::seconds(10));
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLocked);
  EXPECT_LE(true_spread(stand), Duration::microseconds(150));
  const wire::Genlock now = host.status().genlock();
  ASSERT_EQ(now.unaligned_size(), 1);
  EXPECT_EQ(now.unaligned(0), "head 'cam3' cannot shift its exposures; it runs on its own clock");
}

TEST(Align, TwoThatCannotBeMoved_AreGroupedByTimeAndNamedAndNothingIsCalledLocked) {
  Stand stand(free_rig({}, [](HeadIndex i, hal::sim::HeadOptions& head) {
    head.free_run_phase = kPeriod * i / kHeads;
    if (i == 1 || i == 4) head.limits.nudge = {};
  }));
  TestHost& host = stand.bring_up();
  stand.run(Duration::seconds(5));
  const std::uint64_t full = stand.capture().full_sets;
  stand.run(Duration::seconds(5));
  EXPECT_GE(stand.capture().full_sets - full, 140u);
  const wire::Genlock now = host.status().genlock();
  EXPECT_EQ(now.state(), "acquiring");
  EXPECT_GT(now.spread_ns(), 10'000'000u) << "half a period apart";
  ASSERT_EQ(now.unaligned_size(), 2);
  EXPECT_NE(now.unaligned(0).find("'cam1'"), std::string::npos);
  EXPECT_NE(now.unaligned(1).find("'cam4'"), std::string::npos);
}

TEST(Align, HeadsThatCanOnlyWait_AllWaitForTheLatest) {
  Stand stand(free_rig({}, [](HeadIndex, hal::sim::HeadOptions& head) { head.limits.nudge.shortest = {}; }));
  ASSERT_TRUE(locks(stand));
  stand.run(Duration::seconds(20));
  EXPECT_EQ(stand.capture().genlock.losses, 0u);
  EXPECT_LE(true_spread(stand), Duration::microseconds(200));
}

TEST(Align, AHeadNoLongerDoesWhatItIsAsked_HoldoverWhileInStepThenLostAndItIsNamed) {
  Stand stand(free_rig());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(locks(stand));
  stand.run(Duration::seconds(10));
  stand.world.head(0).set_stuck(true);
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kHoldover; }));
  EXPECT_LE(true_spread(stand), Duration::microseconds(500));
  EXPECT_EQ(host.status().genlock().unaligned(0), "head 'cam0' is asked to shift its exposures and does not");
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLost; }));
  stand.world.head(0).set_stuck(false);
  EXPECT_TRUE(locks(stand));
  EXPECT_EQ(host.status().genlock().unaligned_size(), 0);
}

TEST(Align, AnExposureIsChanged_TheMiddlesStayInStep) {
  Stand stand(free_rig());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(locks(stand));
  stand.run(Duration::seconds(10));
  wire::Request request;
  request.mutable_head_set()->add_heads(2);
  request.mutable_head_set()->set_exposure_ns(6'000'000);  // its mid-exposures would move 2 ms earlier
  ASSERT_TRUE(host.ask(request).has_done());
  stand.run(Duration::seconds(5));
  EXPECT_EQ(stand.capture().heads[2].in_effect.exposure, Exposure::microseconds(6000));
  EXPECT_EQ(stand.capture().genlock.losses, 0u);
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLocked);
  EXPECT_LE(true_spread(stand), Duration::microseconds(150));
}

TEST(Align, AnotherRateOrAPulse_IsRefusedWithTheReason) {
  Stand stand(free_rig());
  TestHost& host = stand.bring_up();
  wire::Request request;
  request.mutable_genlock()->set_action(wire::GenlockRequest::START);
  request.mutable_genlock()->set_rate_numerator(15);
  request.mutable_genlock()->set_rate_denominator(1);
  const wire::Reply refused = host.ask(request);
  EXPECT_EQ(refused.error().code(), static_cast<unsigned>(Errc::kUnsupported));
  EXPECT_NE(refused.error().message().find("source"), std::string::npos);
}

TEST(Align, Stopped_HeadsDriftApartAndTheStateIsOff) {
  Stand stand(free_rig());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(locks(stand));
  wire::Request request;
  request.mutable_genlock()->set_action(wire::GenlockRequest::STOP);
  EXPECT_EQ(host.ask(request).genlock().state(), "off");
  stand.run(Duration::seconds(20));
  // 100 ppm of drift for 20 s.
  EXPECT_NEAR(static_cast<double>(true_spread(stand).us()), 2000, 250);
}

}  // namespace
}  // namespace nodal::scenario
