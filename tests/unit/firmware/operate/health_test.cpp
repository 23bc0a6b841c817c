#include "firmware/operate/health.h"

#include <gtest/gtest.h>

#include <array>
#include <string_view>

#include "hal/sim/clock.h"
#include "hal/sim/watchdog.h"

namespace nodal::firmware {
namespace {

class HealthTest : public testing::Test {
 protected:
  HealthTest() {
    config.heads.resize(2);
    config.heads[0].name = "left";
    config.heads[1].name = "right";
    capture.heads.resize(2);
    for (HeadReport& head : capture.heads) head.present = true;
    keeper.ready = true;
    keeper.in_force = Sha256{};
  }
  Health judged() {
    const Diagnosis found = diagnose(config, {capture, keeper, 29'970, rate, unfit, since_last_set, blending, shed,
                                              settings, recording, since_lost_set, threads, undecodable});
    return {rig_state_name(transition(found.condition, RigState::kRunning).to), found.sentence};
  }

  RigConfig config;
  CaptureReport capture;
  KeeperReport keeper;
  std::uint32_t rate = 29'970;
  std::uint64_t unfit = 0;
  Duration since_last_set;
  Duration blending = Duration::seconds(60);
  ShedLevel shed;
  std::string settings;
  const TakeReport* recording = nullptr;
  Duration since_lost_set = Duration::seconds(1000);
  std::vector<hal::Heartbeat> threads;
  std::string undecodable;
};

TEST_F(HealthTest, EverythingRight_IsRunningWithoutAProblem) {
  EXPECT_EQ(judged().state, "running");
  EXPECT_EQ(judged().problem, "");
}

TEST_F(HealthTest, TheStoreIsBeingRead_IsStarting) {
  keeper.ready = false;
  EXPECT_EQ(judged().state, "starting");
}

TEST_F(HealthTest, NoCalibration_GoesBeforeEverythingElse) {
  keeper.in_force.reset();
  capture.heads[0].present = false;
  EXPECT_EQ(judged().state, "no-calibration");
}

TEST_F(HealthTest, NoFrames_IsIdleAndNamesTheHeadsThatAreAway) {
  since_last_set = Duration::seconds(2);
  EXPECT_EQ(judged().state, "idle");
  for (HeadReport& head : capture.heads) {
    head.present = false;
    head.problem = "unplugged";
  }
  EXPECT_NE(judged().problem.find("heads 'left', 'right' are missing: unplugged"), std::string::npos)
      << judged().problem;
}

TEST_F(HealthTest, AHeadAway_IsDegradedAndNamesIt) {
  capture.heads[1].present = false;
  capture.heads[1].problem = "unplugged";
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, "head 'right' is missing: unplugged");
}

TEST_F(HealthTest, GenlockLost_IsDegradedAndSaysSo) {
  capture.genlock.state = GenlockState::kLost;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("genlock is lost"), std::string::npos);
}

TEST_F(HealthTest, Holdover_IsDegradedAndSaysWhatIsMissing) {
  capture.genlock.state = GenlockState::kHoldover;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("the trigger's pulses are not seen"), std::string::npos) << judged().problem;
  capture.genlock.aligned = true;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("does not carry out its nudges"), std::string::npos) << judged().problem;
}

TEST_F(HealthTest, SettingsThatCannotBeStored_AreDegradedWithTheReason) {
  settings = "settings will not survive a restart: no space";
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, settings);
}

TEST_F(HealthTest, TheFullRateThoughHostsAreGivenLess_NamesWhatIsLeftOutAndNoRate) {
  shed = {2, 1};
  EXPECT_EQ(judged().problem, "the board is overloaded; hosts get 1 of 2 raymaps");
  EXPECT_EQ(judged().state, "degraded");
}

TEST_F(HealthTest, TooSlow_IsDegradedWithBothRates) {
  rate = 28'500;
  EXPECT_EQ(judged().state, "running") << "within a twentieth";
  rate = 20'120;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("20.12 raymaps a second are made instead of 29.97"), std::string::npos)
      << judged().problem;
}

TEST_F(HealthTest, TheRateOfTheFirst5SOfABlend_IsNotJudged) {
  rate = 10'000;
  blending = Duration::seconds(5);
  EXPECT_EQ(judged().state, "running");
  blending = Duration::seconds(5) + Duration::nanoseconds(1);
  EXPECT_EQ(judged().state, "degraded");
}

TEST_F(HealthTest, RatesWithinMeasuringError_AreNeverCalledTooSlow) {
  for (const ShedLevel& level : {ShedLevel{1, 1}, ShedLevel{2, 1}, ShedLevel{8, 4}}) {
    shed = level;
    for (rate = 29'970 * 19 / 20 + 1; rate < 2 * 29'970; rate += 7) {
      ASSERT_EQ(judged().problem.find("too slow"), std::string::npos) << judged().problem;
    }
  }
}

TEST_F(HealthTest, AHeadInNoSet_IsDegradedWithTheReason) {
  capture.heads[1].in_no_set = true;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, "head 'right' delivers no frames");
  capture.heads[1].newest_loss = LossReason::kCorrupt;
  EXPECT_EQ(judged().problem, "head 'right': none of its frames can be used; the newest: corrupt");
}

TEST_F(HealthTest, FramesThatDoNotFitTheCalibration_AreAProblem) {
  unfit = 1;
  EXPECT_EQ(judged().state, "degraded");
}

TEST_F(HealthTest, FramesThatCannotBeDecoded_AreAProblemOfThatHead) {
  undecodable = "head 'cam1': its pictures end early";
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, undecodable);
}

TEST_F(HealthTest, WorkIsShed_IsDegradedAndSaysWhatIsLeftUndone) {
  shed = {4, 1};
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("1 of 4 raymaps"), std::string::npos) << judged().problem;
  EXPECT_EQ(judged().problem.find("is blended"), std::string::npos);
  shed = {8, 2};
  EXPECT_NE(judged().problem.find("1 of 2 sets is blended"), std::string::npos) << judged().problem;
}

TEST_F(HealthTest, TheDiskIsTooSlowForTheTake_IsDegradedAndSaysWhatIsLost) {
  config.takes = TakesConfig{.folder = "takes", .quality = 90};
  TakeReport takes;
  takes.recording = 7;
  takes.quality = 90;
  takes.lost_sets = 12;
  recording = &takes;
  EXPECT_EQ(judged().state, "running") << "what was lost is long ago";
  takes.quality = 75;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, "the disk is too slow for the take: JPEG quality is 75 of 90");
  takes.leaves_out_raymaps = true;
  since_lost_set = Duration::seconds(3);
  EXPECT_EQ(judged().problem,
            "the disk is too slow for the take: JPEG quality is 75 of 90, raymaps are left out, 12 sets were lost");
}

TEST_F(HealthTest, AnErrorOfTheDiskLostSets_IsNamedAndTheDiskIsNotCalledSlow) {
  config.takes = TakesConfig{.folder = "takes"};
  TakeReport takes;
  takes.recording = 7;
  takes.lost_sets = takes.lost_by_errors = 12;
  takes.problem = "take 7: 12 sets were lost by an error of the disk: Input/output error";
  recording = &takes;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, takes.problem);
}

TEST_F(HealthTest, ATakeEndedByItself_IsDegradedUntilTheNextBegins) {
  config.takes = TakesConfig{.folder = "takes"};
  TakeReport takes;
  takes.problem = "take 7 ended: the disk is full";
  recording = &takes;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, takes.problem);
  takes.problem.clear();
  takes.recording = 8;
  EXPECT_EQ(judged().state, "running");
}

TEST_F(HealthTest, AThreadOfTheTakesDiskIsAtOneCallForOver5S_IsDegradedUntilItReturns) {
  for (const char* name : {"nodal-takes", "nodal-read"}) {
    threads = {{"nodal-capture", Duration::milliseconds(1)}, {name, Duration::milliseconds(5000)}};
    EXPECT_EQ(judged().state, "running");
    threads[1].busy = Duration::milliseconds(5001);
    EXPECT_EQ(judged().state, "degraded");
    EXPECT_EQ(judged().problem, "the takes' disk does not answer");
    threads[1].busy = Duration();
    EXPECT_EQ(judged().state, "running");
  }
}

TEST_F(HealthTest, ADevicesThreadIsAtOneCallForOver15S_IsDegradedAndNamesIt) {
  threads = {{"nodal-device v4l2:/dev/video2", Duration::seconds(15)}};
  EXPECT_EQ(judged().state, "running");
  threads[0].busy = Duration::seconds(16);
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, "the thread 'nodal-device v4l2:/dev/video2' has been at one call for over 15 s");
}

TEST_F(HealthTest, TheRecorderIsStuck_IsHanging) {
  threads = {{"nodal-record", Duration::seconds(6)}};
  EXPECT_EQ(judged().state, "hanging");
}

constexpr std::array kStates{RigState::kStarting, RigState::kNoCalibration, RigState::kIdle,    RigState::kRunning,
                             RigState::kDegraded, RigState::kHanging,       RigState::kStopping};

// The expected table, as in firmware/README.md: one letter per state, conditions from worst to best.
constexpr std::string_view kLetters = "sciRDHX";  // starting no-Calibration idle Running Degraded Hanging stopping(X)
constexpr std::array<std::string_view, kConditions> kExpected{
    "XXXXXXX",  // kEnding
    "HHHHHHX",  // kStageHangs
    "ssssssX",  // kStoreUnread
    "ccccccX",  // kNoCalibration
    "iiiiiiX",  // kNoFrames
    "DDDDDDX",  // kDiskSilent
    "DDDDDDX",  // kHeadMissing
    "DDDDDDX",  // kGenlockLost
    "DDDDDDX",  // kHoldover
    "DDDDDDX",  // kUnfitFrames
    "DDDDDDX",  // kStoreTrouble
    "DDDDDDX",  // kHeadTrouble
    "DDDDDDX",  // kTakeTrouble
    "DDDDDDX",  // kThreadSilent
    "DDDDDDX",  // kTooSlow
    "RRRRRRX",  // kHealthy
};

TEST(SupervisorTable, EveryConditionInEveryState_GoesWhereItMustAndActsSafely) {
  for (std::size_t c = 0; c < kConditions; ++c) {
    for (const RigState from : kStates) {
      const Transition next = transition(static_cast<Condition>(c), from);
      const char letter = kExpected[c][static_cast<std::size_t>(from)];
      EXPECT_EQ(kLetters[static_cast<std::size_t>(next.to)], letter) << c << " in " << rig_state_name(from);
      // Only a hang stops feeding the watchdog; only a requested stop ends the rig; the rig is not ready before the
      // store has been read.
      EXPECT_EQ(next.actions.feed, letter != 'H');
      EXPECT_EQ(next.actions.end, letter == 'X');
      EXPECT_EQ(next.actions.ready, letter != 's' && letter != 'H' && letter != 'X');
    }
  }
}

class SupervisorTest : public testing::Test {
 protected:
  /// About half a minute, in steps of a tenth of a second.
  void seconds(int n, bool moving, bool may_idle, const Diagnosis& found = {}) {
    for (int i = 0; i < n * 10; ++i) {
      if (moving) ++progress;
      supervisor.step({{"capture", static_cast<std::uint64_t>(clock.now().ns()), false}, {"blend", progress, may_idle}},
                      found, clock.now());
      clock.advance(Duration::milliseconds(100));
    }
  }
  hal::sim::SimClock clock;
  hal::sim::SimWatchdog watchdog{clock};
  Supervisor supervisor{&watchdog};
  std::uint64_t progress = 0;
};

TEST_F(SupervisorTest, AStageThatHangs_IsNamedAndTheWatchdogGoesHungryUntilItGetsOn) {
  seconds(20, true, false);
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1)));
  seconds(60, false, true);
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1))) << "nothing to do is not hanging";
  seconds(15, false, false);
  EXPECT_EQ(supervisor.state(), RigState::kHanging);
  EXPECT_TRUE(watchdog.would_bite(Duration::seconds(5)));
  EXPECT_EQ(watchdog.lines().back(), "hanging: the blend stage has made no progress for 5 s");
  seconds(2, true, false);
  EXPECT_EQ(supervisor.state(), RigState::kRunning);
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1)));
}

TEST_F(SupervisorTest, AStageThatRestsForExactly5S_DoesNotHangYet) {
  const auto step = [&](Duration since) {
    supervisor.step({{"blend", 1, false}}, {}, Instant() + since);
    return supervisor.state();
  };
  EXPECT_EQ(step(Duration()), RigState::kRunning);
  EXPECT_EQ(step(Supervisor::kStuckAfter), RigState::kRunning);
  EXPECT_EQ(step(Supervisor::kStuckAfter + Duration::nanoseconds(1)), RigState::kHanging);
}

TEST_F(SupervisorTest, StoreNotYetRead_SystemdIsNotToldReadyAndFedAllTheSame) {
  seconds(3, true, false, {Condition::kStoreUnread, "reading the calibration store"});
  EXPECT_FALSE(watchdog.is_ready());
  EXPECT_GE(watchdog.feeds(), 5U);
  seconds(1, true, false, {Condition::kNoCalibration, "upload one"});
  EXPECT_TRUE(watchdog.is_ready()) << "hosts are served without a calibration";
}

TEST_F(SupervisorTest, EndedTwice_TheFirstReasonStaysWhateverComes) {
  seconds(2, true, false);
  supervisor.end("SIGTERM");
  supervisor.end("something else");
  seconds(1, true, false, {Condition::kHeadMissing, "head 'left' is not there"});
  EXPECT_EQ(supervisor.health().state, "stopping");
  EXPECT_EQ(supervisor.health().problem, "SIGTERM");
  EXPECT_TRUE(watchdog.is_stopping());
  EXPECT_EQ(watchdog.lines().back(), "stopping: SIGTERM");
  EXPECT_TRUE(supervisor.actions().end);
}

}  // namespace
}  // namespace nodal::firmware
