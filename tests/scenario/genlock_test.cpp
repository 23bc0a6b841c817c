#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::GenlockState;

constexpr Duration kGenlockPeriod = Duration::nanoseconds(33'366'666);

wire::Request genlock_request(wire::GenlockRequest::Action action) {
  wire::Request request;
  request.mutable_genlock()->set_action(action);
  return request;
}

TEST(Genlock, Started_LocksEveryHeadToWithinItsJitter) {
  Stand stand;
  TestHost& host = stand.bring_up();
  EXPECT_EQ(host.status().genlock().state(), "off");
  const wire::Reply started = host.ask(genlock_request(wire::GenlockRequest::START));
  EXPECT_EQ(started.genlock().state(), "acquiring");
  ASSERT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, Duration::seconds(1)));
  stand.run(Duration::seconds(5));
  const wire::Genlock now = host.status().genlock();
  EXPECT_EQ(now.state(), "locked");
  EXPECT_EQ(now.missing_triggers(), 0u);
  // An exposure begins 20 us +- 2 us after its pulse: two heads differ by at most 4 us.
  EXPECT_LE(now.spread_worst_ns(), 4'000u);
  EXPECT_GT(now.spread_worst_ns(), 0u);
}

TEST(Genlock, WhileLocked_EverySetHoldsTheFramesOfOnePulse) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId stream = host.pull(false, 20, true);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  std::uint64_t expected = 0;
  for (const Pulled& raymap : host.pulled[stream]) {
    ASSERT_TRUE(raymap.header.has_trigger());
    EXPECT_TRUE(expected == 0 || raymap.header.trigger() == expected) << raymap.header.trigger();
    expected = raymap.header.trigger() + 1;
    EXPECT_EQ(raymap.header.heads_mask(), (1u << kHeads) - 1);
    EXPECT_EQ(raymap.header.genlock(), "locked");
    EXPECT_LE(raymap.header.spread_ns(), 4'000u);
    EXPECT_LE(raymap.header.begin_spread_ns(), 4'000u);
    ASSERT_EQ(raymap.header.offset_ns_size(), kHeads);
    const auto [first, last] = std::minmax_element(raymap.header.offset_ns().begin(), raymap.header.offset_ns().end());
    EXPECT_EQ(static_cast<std::uint64_t>(*last - *first), raymap.header.spread_ns());
  }
}

TEST(Genlock, TheGeneratorsCrystalIsOff_EverySetSaysByHowMuch) {
  StandOptions options;
  options.world.trigger.drift_ppb = 47'000;
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.run(Duration::seconds(20));
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const wire::RaymapHeader& header = host.pulled[stream].at(0).header;
  ASSERT_TRUE(header.has_drift_ppb());
  EXPECT_NEAR(header.drift_ppb(), 47'000, 100);
}

TEST(Genlock, TheTriggerDies_ItIsLostWithinThreePeriodsAndSaysSo) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.world.trigger().unplug();
  stand.run(kGenlockPeriod * 3);
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLost);
  EXPECT_EQ(host.status().genlock().state(), "lost");
}

TEST(Genlock, PulsesAreMissing_ItIsLostAndLocksAgainByItself) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  for (int i = 0; i < 5; ++i) stand.world.trigger().lose_pulse();
  EXPECT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLost; }, kGenlockPeriod * 4));
  EXPECT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, Duration::seconds(1)));
  EXPECT_EQ(host.status().genlock().missing_triggers(), 5u);
}

TEST(Genlock, Stopped_HeadsRunFreeAgain) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  EXPECT_EQ(host.ask(genlock_request(wire::GenlockRequest::STOP)).genlock().state(), "off");
  stand.run(Duration::seconds(1));
  const std::uint64_t sets = stand.capture().sets;
  stand.run(Duration::seconds(1));
  EXPECT_NEAR(static_cast<double>(stand.capture().sets - sets), 30, 2);
  EXPECT_FALSE(stand.world.trigger().running());
}

TEST(Genlock, AnotherRate_IsWhatTheSetsComeAt) {
  Stand stand;
  TestHost& host = stand.bring_up();
  wire::Request request = genlock_request(wire::GenlockRequest::START);
  request.mutable_genlock()->set_rate_numerator(15);
  request.mutable_genlock()->set_rate_denominator(1);
  ASSERT_TRUE(host.ask(request).has_genlock());
  stand.run(Duration::seconds(1));
  const std::uint64_t sets = stand.capture().full_sets;
  stand.run(Duration::seconds(4));
  EXPECT_NEAR(static_cast<double>(stand.capture().full_sets - sets), 60, 1);
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLocked);
}

TEST(Genlock, RatesAndPulsesThatCannotBe_AreRefusedAndNothingChanges) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  wire::Request request = genlock_request(wire::GenlockRequest::START);
  request.mutable_genlock()->set_rate_numerator(30);
  EXPECT_EQ(host.ask(request).error().code(), static_cast<unsigned>(Errc::kBadValue));
  request.mutable_genlock()->set_rate_denominator(1);
  request.mutable_genlock()->set_pulse_width_ns(40'000'000);
  EXPECT_EQ(host.ask(request).error().code(), static_cast<unsigned>(Errc::kBadValue));
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLocked);
}

// The rates that once made the trigger loop forever after milliseconds, a minute and two hours.
TEST(Genlock, RatesWhoseProductsExceed64Bits_AreReducedOrRefused) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  wire::Request request = genlock_request(wire::GenlockRequest::START);
  for (const auto& [numerator, denominator] : {std::pair{299'700'300U, 10'000'000U}, {2'997'003U, 100'000U}}) {
    request.mutable_genlock()->set_rate_numerator(numerator);
    request.mutable_genlock()->set_rate_denominator(denominator);
    const wire::Error error = host.ask(request).error();
    EXPECT_EQ(error.code(), static_cast<unsigned>(Errc::kBadValue));
    EXPECT_NE(error.message().find("1/1000 to 1000 frames a second"), std::string::npos) << error.message();
  }
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kLocked);
  request.mutable_genlock()->set_rate_numerator(4'294'967'295);
  request.mutable_genlock()->set_rate_denominator(4'294'967'295);
  const wire::Reply reduced = host.ask(request);
  EXPECT_EQ(reduced.genlock().rate_numerator(), 1U);
  EXPECT_EQ(reduced.genlock().rate_denominator(), 1U);
  const std::uint64_t sets = stand.capture().full_sets;
  stand.run(Duration::seconds(10));
  EXPECT_NEAR(static_cast<double>(stand.capture().full_sets - sets), 10, 1);
}

// The clock advances while a board is suspended; afterwards a day of pulses and exposures has passed.
TEST(Genlock, SuspendedForADay_GoesOnWithinASecond) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.world.clock().advance(Duration::seconds(86'400));
  EXPECT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, Duration::seconds(1)));
  // Hosts that were silent for a day have been disconnected.
  TestHost& later = stand.connect();
  EXPECT_GE(later.status().genlock().missing_triggers(), 86'000U * 29);
  EXPECT_GE(stand.world.head(0).counts().without_buffer, 86'000U * 29);
  ASSERT_TRUE(later.ask(genlock_request(wire::GenlockRequest::STOP)).has_genlock());
  stand.run(Duration::seconds(1));
  stand.world.clock().advance(Duration::seconds(86'400));
  const std::uint64_t sets = stand.capture().full_sets;
  stand.run(Duration::seconds(3));
  EXPECT_GE(stand.capture().full_sets - sets, 30U);
}

TEST(Genlock, SomebodyElseDrivesTheLine_ItIsFollowedAndSetsNameItsPulses) {
  StandOptions options;
  options.config.trigger.source = firmware::SyncSource::kExternal;
  options.world.trigger.external = FrameRate{};
  options.world.trigger.drift_ppb = -30'000;
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.run(Duration::seconds(20));
  const wire::Genlock now = host.status().genlock();
  EXPECT_EQ(now.state(), "locked");
  EXPECT_EQ(now.missing_triggers(), 0u);
  EXPECT_LE(now.spread_worst_ns(), 4'000u);
  EXPECT_NEAR(now.drift_ppb(), -30'000, 100);
}

TEST(Genlock, NobodyDrivesTheLineThatIsToBeFollowed_TheStartSaysSo) {
  StandOptions options;
  options.config.trigger.source = firmware::SyncSource::kExternal;
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  EXPECT_EQ(host.ask(genlock_request(wire::GenlockRequest::START)).error().code(),
            static_cast<unsigned>(Errc::kUnsupported));
  EXPECT_EQ(stand.capture().genlock.state, GenlockState::kOff);
}

TEST(Genlock, AHeadsDelay_MovesItsExposureAndNotTheLock) {
  StandOptions options;
  options.config.heads[2].trigger_delay = Duration::milliseconds(3);
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const wire::RaymapHeader& header = host.pulled[stream].at(0).header;
  EXPECT_EQ(header.genlock(), "locked");
  EXPECT_LE(header.begin_spread_ns(), 4'000u);
  EXPECT_NEAR(static_cast<double>(header.offset_ns(2)), 3e6, 5e3);
}

/// Head 2 is wired: its driver does not know of the line. Its exposures begin 7 ms after the pulse.
StandOptions one_wired() {
  StandOptions options;
  options.config.heads[2].wired = true;
  options.config.heads[2].trigger_delay = Duration::milliseconds(7);
  options.world.adjust = [](HeadIndex index, hal::sim::HeadOptions& head) {
    if (index != 2) return;
    head.limits.has_trigger_input = false;
    head.trigger_latency = Duration::milliseconds(7) + Duration::microseconds(20);
    head.free_run_drift_ppm = 50;
  };
  return options;
}

TEST(Genlock, AWiredHead_IsInLockWithTheOthersAndIsNotRestarted) {
  Stand stand(one_wired());
  TestHost& host = stand.bring_up();
  stand.run(Duration::seconds(1));
  stand.lock(host);
  stand.run(Duration::seconds(10));
  const wire::Genlock now = host.status().genlock();
  EXPECT_EQ(now.state(), "locked");
  EXPECT_EQ(now.unaligned_size(), 0) << now.unaligned(0);
  const wire::Heads heads = host.heads();
  for (const wire::HeadState& head : heads.heads()) {
    EXPECT_EQ(head.trigger(), head.index() == 2 ? "wired" : "input") << head.name();
  }
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const wire::RaymapHeader& header = host.pulled[stream].at(0).header;
  EXPECT_EQ(header.heads_mask(), (1U << kHeads) - 1);
  EXPECT_LE(header.begin_spread_ns(), 4'000U);
  EXPECT_NEAR(static_cast<double>(header.offset_ns(2)), 7e6, 5e3);
  EXPECT_EQ(stand.capture().heads[2].opened, 1U);
  EXPECT_EQ(host.ask(genlock_request(wire::GenlockRequest::STOP)).genlock().state(), "off");
  const std::uint64_t frames = stand.capture().heads[2].counts.frames;
  stand.run(Duration::seconds(1));
  EXPECT_NEAR(static_cast<double>(stand.capture().heads[2].counts.frames - frames), 30, 1);
  EXPECT_EQ(host.heads().heads(0).trigger(), "free");
  EXPECT_EQ(host.heads().heads(2).trigger(), "wired");
  stand.world.head(0).unplug();
  EXPECT_TRUE(stand.run_until([&] { return host.heads().heads(0).trigger().empty(); }, Duration::seconds(2)));
}

TEST(Genlock, TheCableOfAWiredHeadIsPulled_ItIsReportedByNameAndTheLockIsNotKept) {
  Stand stand(one_wired());
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.run(Duration::seconds(20));
  stand.world.head(2).set_cable(false);
  stand.run(Duration::seconds(15));
  wire::Genlock now = host.status().genlock();
  ASSERT_EQ(now.unaligned_size(), 1);
  EXPECT_NE(now.unaligned(0).find("head 'cam2' does not follow the trigger"), std::string::npos) << now.unaligned(0);
  EXPECT_NE(now.unaligned(0).find("+50 ppm"), std::string::npos) << now.unaligned(0);
  EXPECT_NE(now.state(), "locked");
  stand.world.head(2).set_cable(true);
  EXPECT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, Duration::seconds(1)));
  stand.run(Duration::seconds(10));
  now = host.status().genlock();
  EXPECT_EQ(now.unaligned_size(), 0) << now.unaligned(0);
  EXPECT_EQ(now.state(), "locked");
}

TEST(Genlock, AWiredHeadOfHalfTheRate_IsReportedByName) {
  Stand stand(one_wired());
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.world.head(2).set_pulses_an_exposure(2);
  stand.run(Duration::seconds(2));
  const wire::Genlock now = host.status().genlock();
  ASSERT_EQ(now.unaligned_size(), 1);
  EXPECT_NE(now.unaligned(0).find("head 'cam2' does not follow every trigger"), std::string::npos) << now.unaligned(0);
}

TEST(Genlock, RigTomlSaysStart_ItLocksWithoutAHost) {
  StandOptions options;
  options.config.trigger.start = true;
  Stand stand(std::move(options));
  EXPECT_TRUE(
      stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }, Duration::seconds(1)));
}

TEST(Exposure, Set_IsInEffectInEveryHeadAfterItsLatency) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  wire::Request request;
  request.mutable_head_set()->set_exposure_ns(2'500'000);
  request.mutable_head_set()->set_red_q12(6144);
  request.mutable_head_set()->set_blue_q12(3072);
  ASSERT_TRUE(host.ask(request).has_done());
  EXPECT_NE(host.heads().heads(0).exposure_ns(), 2'500'000u) << "what is told is what was in effect, not the wish";
  stand.run(kGenlockPeriod * 6);
  const wire::Heads heads = host.heads();
  for (const wire::HeadState& head : heads.heads()) {
    EXPECT_EQ(head.exposure_ns(), 2'500'000u) << head.name();
    EXPECT_EQ(head.red_q12(), 6144u);
    EXPECT_EQ(head.blue_q12(), 3072u);
  }
}

TEST(Exposure, TwiceAsLong_IsTwiceAsBright) {
  StandOptions options;
  options.world.scene = hal::sim::constant_scene({0.2F, 0.2F, 0.2F});
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  wire::Request request;
  request.mutable_head_set()->set_exposure_ns(20'000'000);  // the reference is 10 ms
  ASSERT_TRUE(host.ask(request).has_done());
  stand.run(kGenlockPeriod * 8);
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  for (const std::uint8_t value : host.pulled[stream].at(0).body) ASSERT_EQ(value, 102);  // 0.4 of 255
}

TEST(Exposure, OutsideAHeadsLimits_NamesItAndChangesNone) {
  Stand stand;
  TestHost& host = stand.bring_up();
  wire::Request request;
  request.mutable_head_set()->set_exposure_ns(50'000'000);
  const wire::Reply refused = host.ask(request);
  EXPECT_EQ(refused.error().code(), static_cast<unsigned>(Errc::kBadValue));
  EXPECT_NE(refused.error().message().find("'cam0'"), std::string::npos) << refused.error().message();
  EXPECT_NE(refused.error().message().find("33000 us"), std::string::npos) << refused.error().message();
  request.mutable_head_set()->set_exposure_ns(1'000'000);
  request.mutable_head_set()->add_heads(17);
  EXPECT_EQ(host.ask(request).error().code(), static_cast<unsigned>(Errc::kBadValue));
  stand.run(kGenlockPeriod * 6);
  EXPECT_EQ(host.heads().heads(0).exposure_ns(), 10'000'000u);
}

TEST(Exposure, InRigToml_IsAskedWhenTheHeadIsOpened) {
  StandOptions options;
  options.config.heads[3].exposure = Exposure::microseconds(1234);
  options.config.heads[3].gain = Gain::millidecibels(3000);
  Stand stand(std::move(options));
  stand.run(Duration::milliseconds(500));
  EXPECT_EQ(stand.capture().heads[3].in_effect.exposure, Exposure::microseconds(1234));
  EXPECT_EQ(stand.capture().heads[3].in_effect.gain, Gain::millidecibels(3000));
}

}  // namespace
}  // namespace nodal::scenario
