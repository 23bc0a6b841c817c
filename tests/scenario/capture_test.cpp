// Heads that disconnect and reconnect, bad frames, and a delayed capture thread.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::LossReason;

/// Runs until every set contains every head again.
bool full_again(Stand& stand, Duration within) {
  std::uint64_t sets = stand.capture().sets;
  std::uint64_t full = stand.capture().full_sets;
  return stand.run_until(
      [&] {
        const bool missing = stand.capture().sets - sets != stand.capture().full_sets - full;
        if (missing) {
          sets = stand.capture().sets;
          full = stand.capture().full_sets;
        }
        return stand.capture().full_sets >= full + 5;
      },
      within);
}

TEST(Capture, WhenTheThreadStalls_NothingIsLostThatTheHeadsHadBuffersFor) {
  for (const bool locked : {false, true}) {
    Stand stand;
    TestHost& host = stand.bring_up();
    if (locked) stand.lock(host);
    const std::uint64_t lost = stand.capture().frames.lost();
    const std::uint64_t sets = stand.capture().sets;
    for (int stall = 0; stall < 20; ++stall) {
      stand.world.clock().advance(Duration::milliseconds(150 + 5 * stall));  // up to 7 of the 8 buffers
      stand.settle();
      stand.run(Duration::milliseconds(50));
    }
    EXPECT_EQ(stand.capture().frames.lost(), lost) << (locked ? "locked" : "in free run");
    EXPECT_GT(stand.capture().sets, sets + 140);
  }
}

TEST(Capture, AHeadIsUnpluggedAndReturns_TheOthersGoOnAndItsSettingsAreAskedAgain) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  wire::Request set;
  set.mutable_head_set()->add_heads(2);
  set.mutable_head_set()->set_exposure_ns(4'000'000);
  set.mutable_head_set()->set_gain_mdb(6000);
  ASSERT_TRUE(host.ask(set).has_done());
  stand.run(Duration::milliseconds(300));

  stand.world.head(2).unplug();
  const std::uint64_t sets = stand.capture().sets;
  stand.run(Duration::seconds(1));
  EXPECT_NEAR(static_cast<double>(stand.capture().sets - sets), 30, 2);
  EXPECT_EQ(stand.state(), "degraded");
  wire::Heads heads = host.heads();
  EXPECT_FALSE(heads.heads(2).present());
  EXPECT_NE(host.status().problem().find("'cam2'"), std::string::npos) << host.status().problem();
  EXPECT_EQ(host.status().genlock().state(), "locked");

  stand.world.head(2).replug();
  EXPECT_TRUE(full_again(stand, Duration::seconds(2)));
  stand.run(Duration::milliseconds(300));
  heads = host.heads();
  EXPECT_TRUE(heads.heads(2).present());
  EXPECT_EQ(heads.heads(2).opened(), 2u);
  EXPECT_EQ(heads.heads(2).exposure_ns(), 4'000'000u);
  EXPECT_EQ(heads.heads(2).gain_mdb(), 6000);
  EXPECT_EQ(stand.state(), "running") << host.status().problem();
}

TEST(Capture, AHeadIsAway_ItsRaysGoToTheHeadsThatSeeThemToo) {
  StandOptions options;
  options.config.raymap.transition = Transition::kFeather;  // with seams, only ramps do
  options.world.scene = hal::sim::constant_scene({0.5F, 0.5F, 0.5F});
  Stand stand(std::move(options));
  TestHost& host = stand.bring_up();
  stand.world.head(0).unplug();  // the head that looks forward
  stand.run(Duration::milliseconds(300));
  const StreamId stream = host.pull(false, 1);
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  const Pulled& raymap = host.pulled[stream].at(0);
  EXPECT_EQ(raymap.header.heads_mask(), 0b111110u);
  std::size_t seen = 0;
  std::size_t black = 0;
  for (std::size_t i = 0; i < raymap.body.size(); i += 3) {
    ASSERT_TRUE(raymap.body[i] == 128 || raymap.body[i] == 0) << int{raymap.body[i]};
    ++(raymap.body[i] == 0 ? black : seen);
  }
  // Only head 0 sees the area within 35 degrees of forward on both axes: exactly that area must be black.
  const auto pixel = [&](int x, int y) { return raymap.body[static_cast<std::size_t>(y * 128 + x) * 3]; };
  EXPECT_EQ(pixel(64, 32), 0);         // forward
  EXPECT_EQ(pixel(64 + 14, 32), 128);  // 40 degrees to the right: the right head sees it too
  EXPECT_EQ(pixel(64 - 14, 32), 128);
  EXPECT_EQ(pixel(0, 32), 128);  // behind
  EXPECT_GT(black, 0u);
  EXPECT_LT(static_cast<double>(black), 0.14 * static_cast<double>(black + seen));
}

TEST(Capture, AllHeadsGoAndReturn_TheRigIsIdleAndThenRunsAgain) {
  Stand stand;
  stand.bring_up();
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).unplug();
  stand.run(Duration::seconds(3));
  EXPECT_EQ(stand.state(), "idle");
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).replug();
  EXPECT_TRUE(full_again(stand, Duration::seconds(2)));
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.state(), "running");
}

TEST(Capture, BadFrames_AreCountedByTheirReasonAndTheSetGoesOnWithout) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t full = stand.capture().full_sets;
  const std::uint64_t sets = stand.capture().sets;
  stand.world.head(1).corrupt_next_frame();
  stand.world.head(2).tear_next_frame();
  stand.run(Duration::milliseconds(500));
  EXPECT_EQ(stand.losses(1, LossReason::kCorrupt), 1u);
  EXPECT_EQ(stand.losses(2, LossReason::kTorn), 1u);
  EXPECT_EQ(stand.capture().sets - sets - 1, stand.capture().full_sets - full) << "one set lacked both";
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kLocked);

  stand.world.head(3).set_signal(false);
  stand.run(Duration::milliseconds(500));
  stand.world.head(3).set_signal(true);
  stand.run(Duration::milliseconds(200));
  EXPECT_NEAR(static_cast<double>(stand.losses(3, LossReason::kNoSignal)), 15, 1);
  EXPECT_TRUE(full_again(stand, Duration::seconds(1)));
}

TEST(Capture, AFrameThatComesTwice_IsCountedOnce) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t full = stand.capture().full_sets;
  const std::uint64_t sets = stand.capture().sets;
  stand.world.head(4).duplicate_next_frame();
  stand.run(Duration::milliseconds(300));
  // The copy arrives while its set is open, or after the set was closed.
  EXPECT_EQ(stand.losses(4, LossReason::kDuplicate) + stand.losses(4, LossReason::kLate), 1u);
  EXPECT_EQ(stand.capture().sets - sets, stand.capture().full_sets - full);
}

TEST(Capture, AFrameThatComesTooLate_IsCountedAndItsSetWentOnWithout) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t missing = stand.capture().heads[5].missing_sets;
  stand.world.head(5).delay_next_frame(Duration::milliseconds(150));
  stand.run(Duration::milliseconds(600));
  EXPECT_GE(stand.losses(5, LossReason::kLate), 1u);
  EXPECT_GE(stand.capture().heads[5].missing_sets, missing + 1);
  EXPECT_TRUE(full_again(stand, Duration::seconds(1)));
}

TEST(Capture, AHeadThatFallsSilent_HoldsSetsUpOnlyBriefly) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  stand.world.head(0).lose_frames(60);
  const std::uint64_t sets = stand.capture().sets;
  const std::uint64_t missed = stand.rig->control().sets_missed_by_blend();
  stand.run(Duration::seconds(1));
  EXPECT_NEAR(static_cast<double>(stand.capture().sets - sets), 30, 3);
  EXPECT_EQ(stand.rig->control().sets_missed_by_blend(), missed) << "three sets go on at once, and are blended";
  EXPECT_TRUE(full_again(stand, Duration::seconds(3)));
}

TEST(Capture, AHeadThatDeliversNothing_IsNamedInTheLogUntilItDeliversAgain) {
  Stand stand;
  stand.bring_up();
  stand.run(Duration::seconds(1));
  const auto logged = [&](const std::string& what) {
    std::size_t lines = 0;
    for (const std::string& line : stand.rig->control().take_news()) {
      lines += line.find(what) != std::string::npos ? 1U : 0U;
    }
    return lines;
  };
  logged("");
  stand.world.head(3).lose_frames(150);
  stand.run(Duration::seconds(4));
  EXPECT_EQ(stand.state(), "degraded");
  EXPECT_EQ(logged("the state of the rig is now 'degraded': head 'cam3' delivers no frames"), 1U);
  stand.run(Duration::seconds(3));
  EXPECT_EQ(stand.state(), "running");
  EXPECT_EQ(logged("the state of the rig is now 'running'"), 1U);
  hal::sim::HeadFaults every;
  every.corrupt = 1'000'000;
  stand.world.head(3).set_faults(every);
  stand.run(Duration::seconds(4));
  EXPECT_EQ(
      logged(
          "the state of the rig is now 'degraded': head 'cam3': none of its frames can be used; the newest: corrupt"),
      1U);
}

TEST(Capture, NoHeadDeliversAndThereIsNoCalibration_TheLogSaysSo) {
  Stand stand;
  stand.run(Duration::seconds(1));
  stand.rig->control().take_news();
  hal::sim::HeadFaults every;
  every.corrupt = 1'000'000;
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).set_faults(every);
  stand.run(Duration::seconds(3));
  const std::vector<std::string> stops = stand.rig->control().take_news();
  ASSERT_EQ(stops.size(), 1U);
  EXPECT_EQ(stops[0], "no frames arrive; head 'cam0': none of its frames can be used; the newest: corrupt");
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).set_faults({});
  stand.run(Duration::seconds(3));
  EXPECT_EQ(stand.rig->control().take_news(), std::vector<std::string>{"frames arrive"});
}

TEST(Capture, SequenceNumbersThatWrapOrStartAgain_ChangeNothing) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t lost = stand.capture().frames.lost();
  stand.world.head(1).set_sequence(0xffffffffU);
  stand.world.head(2).set_sequence(0);
  stand.run(Duration::seconds(1));
  EXPECT_EQ(stand.capture().frames.lost(), lost);
}

TEST(Capture, FaultsOfEveryKindForAMinute_AreAllAccountedForAndThenItIsWhole) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  hal::sim::HeadFaults faults;
  faults.lose = faults.corrupt = faults.tear = faults.delay = faults.duplicate = 20'000;  // 2 % each
  faults.longest_delay = Duration::milliseconds(200);
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).set_faults(faults);
  stand.run(Duration::seconds(60));  // the stand checks the sums after every millisecond
  EXPECT_GT(stand.capture().frames.lost(), 100u);
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).set_faults({});
  EXPECT_TRUE(full_again(stand, Duration::seconds(2)));
}

TEST(Capture, AHeadDoesNotCarryOutWhatItIsAsked_FramesSaySoAndTheOperatorIsTold) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.world.head(4).set_stuck(true);
  wire::Request set;
  set.mutable_head_set()->set_exposure_ns(5'000'000);
  ASSERT_TRUE(host.ask(set).has_done());
  stand.run(Duration::seconds(1));
  wire::Heads heads = host.heads();
  EXPECT_EQ(heads.heads(3).exposure_ns(), 5'000'000u);
  EXPECT_EQ(heads.heads(3).problem(), "");
  EXPECT_EQ(heads.heads(4).exposure_ns(), 10'000'000u) << "what is in effect, not what was asked";
  EXPECT_NE(heads.heads(4).problem().find("requested 5000 us"), std::string::npos) << heads.heads(4).problem();

  stand.world.head(4).set_stuck(false);
  ASSERT_TRUE(host.ask(set).has_done());
  stand.run(Duration::seconds(1));
  heads = host.heads();
  EXPECT_EQ(heads.heads(4).exposure_ns(), 5'000'000u);
  EXPECT_EQ(heads.heads(4).problem(), "");
}

TEST(Capture, FieldsInTheWrongOrderOrAlone_AreCountedByThatNameAndInNoSet) {
  StandOptions options;
  for (auto& head : options.config.heads) head.fields = Fields::kTopFirst;
  options.world.head.fields = Fields::kTopFirst;
  Stand stand(std::move(options));
  stand.bring_up();
  stand.run(Duration::milliseconds(200));
  const std::uint64_t missing = stand.capture().heads[1].missing_sets;
  for (int i = 0; i < 3; ++i) {
    stand.world.head(1).swap_next_fields();
    stand.world.head(2).lose_next_field();
    stand.run(Duration::milliseconds(200));
  }
  EXPECT_EQ(stand.losses(1, LossReason::kFieldOrder), 3u);
  EXPECT_EQ(stand.losses(2, LossReason::kFieldParity), 3u);
  EXPECT_EQ(stand.losses(0, LossReason::kFieldOrder) + stand.losses(0, LossReason::kFieldParity), 0u);
  EXPECT_EQ(stand.capture().heads[1].missing_sets - missing, 3u);
}

}  // namespace
}  // namespace nodal::scenario
