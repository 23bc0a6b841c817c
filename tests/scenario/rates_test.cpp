// The life of a rig at every frame rate that is allowed: what means "some frames" takes some frames, also when these
// take hours.
#include <gtest/gtest.h>

#include <algorithm>

#include "firmware/operate/health.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::GenlockState;

StandOptions rig_at(FrameRate rate) {
  StandOptions options;
  const Duration period = rate.period();
  options.config.rate = rate;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16};
  options.world.head.readout = std::min(options.world.head.readout, period / 8);
  options.world.head.settings.exposure = Exposure::of(std::min(Duration::milliseconds(8), period / 8));
  return options;
}

class Rates : public testing::TestWithParam<FrameRate> {
 protected:
  Rates() {
    stand.tick = std::clamp(period / 250, Duration::milliseconds(1), Duration::seconds(4));
    EXPECT_TRUE(host.upload(to_json(stand.options.truth)).has_done());
    run(6);
    wire::Request start;
    start.mutable_genlock()->set_action(wire::GenlockRequest::START);
    EXPECT_TRUE(host.ask(start).has_genlock());
    EXPECT_TRUE(within(20, [&] { return stand.capture().genlock.state == GenlockState::kLocked; })) << state();
  }

  void run(int periods) { stand.run(period * periods); }
  /// Some seconds more, because the rig has limits of its own that do not depend on frames.
  bool within(int periods, const std::function<bool()>& holds) {
    return stand.run_until(holds, period * periods + Duration::seconds(10));
  }
  std::string state() { return stand.state() + ": " + stand.rig->control().health().problem; }
  /// Runs for so many periods, and expects at every moment that the rig is well.
  void live(int periods) {
    const Instant end = stand.world.clock().now() + period * periods;
    while (stand.world.clock().now() < end) {
      stand.run(stand.tick);
      ASSERT_EQ(stand.state(), "running") << state();
    }
  }
  /// The answer to a request that the rig answers after some sets.
  wire::Reply ask_and_wait(const std::function<void(wire::Request&)>& fill) {
    wire::Request request;
    fill(request);
    const std::uint64_t id = host.post(request);
    EXPECT_TRUE(within(12, [&] { return host.reply(id) != nullptr; })) << "no answer; " << state();
    return host.reply(id) ? *host.reply(id) : wire::Reply();
  }

  const Duration period = GetParam().period();
  Stand stand{rig_at(GetParam())};
  TestHost& host{stand.connect()};
};

TEST_P(Rates, NothingIsWrong_TheRigRunsWithoutAPauseAndStatesItsRate) {
  live(std::max(30, static_cast<int>(Duration::seconds(4).ns() / period.ns())));
  const wire::RigStatus status = host.status();
  const double wanted = 1e12 / static_cast<double>(period.ns());
  EXPECT_NEAR(status.rate_millihertz(), wanted, std::max(1.0, 0.02 * wanted));
  EXPECT_EQ(status.genlock().state(), "locked");
  EXPECT_EQ(status.set_losses_size() > 0 ? status.frames_taken() - status.frames_in_sets() : 0, 0U)
      << "no frame is lost";
}

TEST_P(Rates, ATakeAMarkAndAStill_HaveTheirSetsAndTheTallyLampStaysOn) {
  live(2);
  ASSERT_TRUE(ask_and_wait([](wire::Request& request) { request.mutable_take_start(); }).has_take());
  run(1);
  const Instant end = stand.world.clock().now() + period * 5;
  while (stand.world.clock().now() < end) {
    stand.run(stand.tick);
    ASSERT_TRUE(stand.tally_lamp.level_at(stand.world.clock().now())) << state();
  }
  EXPECT_TRUE(ask_and_wait([](wire::Request& request) { request.mutable_take_mark()->set_text("here"); }).has_take());
  if (period > Duration::milliseconds(250)) {
    EXPECT_GE(host.status().recording().sets(), 3U) << "a set is on the disk before the next one comes";
  }
  ASSERT_TRUE(ask_and_wait([](wire::Request& request) { request.mutable_take_stop(); }).has_take());
  const wire::Reply still = ask_and_wait([](wire::Request& request) { request.mutable_take_start()->set_still(true); });
  ASSERT_TRUE(still.has_take()) << still.error().message();
  const wire::Takes takes = ask_and_wait([](wire::Request& request) { request.mutable_take_list(); }).takes();
  ASSERT_EQ(takes.takes_size(), 2);
  EXPECT_GE(takes.takes(0).sets(), 5U);
  EXPECT_EQ(takes.takes(0).lost_sets(), 0U);
  EXPECT_EQ(takes.takes(1).sets(), 1U);
  EXPECT_EQ(takes.takes(1).ended(), "still");
}

TEST_P(Rates, AHostAsksForFrameSets_AsDriftAndRegisterDo_ItGetsThem) {
  for (int set = 0; set < 3; ++set) {
    const wire::Reply reply = ask_and_wait([](wire::Request& request) { request.mutable_frame_set(); });
    ASSERT_TRUE(reply.has_pull()) << reply.error().message();
    const StreamId stream = reply.pull().stream();
    ASSERT_TRUE(within(8, [&] { return host.closed.contains(stream); }));
    EXPECT_FALSE(host.closed[stream]) << host.closed[stream]->message;
  }
}

TEST_P(Rates, AnExposureProgram_Settles) {
  live(1);
  const wire::Reply reply =
      ask_and_wait([](wire::Request& request) { request.mutable_exposure()->set_program("each"); });
  ASSERT_TRUE(reply.has_exposure()) << reply.error().message();
  EXPECT_TRUE(within(80, [&] { return stand.capture().exposure.settled && stand.capture().exposure.sets > 3; }));
}

TEST_P(Rates, AHeadIsLostAndComesBack_TheRigIsDegradedMeanwhileOnly) {
  live(2);
  stand.world.head(2).unplug();
  EXPECT_TRUE(within(2, [&] { return stand.state() == "degraded"; })) << state();
  run(6);
  EXPECT_EQ(stand.state(), "degraded") << state();
  EXPECT_NE(state().find("head 'cam2' is missing"), std::string::npos) << state();
  stand.world.head(2).replug();
  EXPECT_TRUE(within(30, [&] { return stand.state() == "running"; })) << state();
  EXPECT_TRUE(within(30, [&] { return stand.capture().genlock.state == GenlockState::kLocked; })) << state();
  live(4);
}

TEST_P(Rates, AHeadDeliversNothing_ItIsNamedAfterSomeSets) {
  live(2);
  stand.world.head(3).lose_frames(1'000'000);
  const int periods = static_cast<int>(Duration::seconds(2).ns() / period.ns()) + 8;
  EXPECT_TRUE(within(periods, [&] { return state().find("head 'cam3' delivers no frames") != std::string::npos; }))
      << state();
}

TEST_P(Rates, NoHeadDelivers_TheRigIsIdleAfterSomePeriodsAndRunsAgain) {
  live(2);
  for (int head = 0; head < kHeads; ++head) stand.world.head(head).set_faults({.lose = 1'000'000});
  EXPECT_TRUE(within(8, [&] { return stand.state() == "idle"; })) << state();
  EXPECT_FALSE(stand.tally_lamp.level_at(stand.world.clock().now()));
  for (int head = 0; head < kHeads; ++head) stand.world.head(head).set_faults({});
  EXPECT_TRUE(within(8, [&] { return stand.state() != "idle"; })) << state();
  EXPECT_TRUE(within(30, [&] { return stand.state() == "running"; })) << state();
}

std::string rate_name(const testing::TestParamInfo<FrameRate>& rate) {
  return std::to_string(rate.param.numerator) + "_in_" + std::to_string(rate.param.denominator) + "_s";
}

INSTANTIATE_TEST_SUITE_P(All, Rates,
                         testing::Values(FrameRate{1, 1000}, FrameRate{1, 5}, FrameRate{1, 1}, FrameRate{30, 1},
                                         FrameRate{240, 1}),
                         rate_name);

}  // namespace
}  // namespace nodal::scenario
