#include "firmware/health.h"

#include <gtest/gtest.h>

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
    return assess(config, {capture, keeper, 29'970, rate, unfit, since_last_set, Duration::seconds(60)});
  }

  RigConfig config;
  CaptureReport capture;
  KeeperReport keeper;
  std::uint32_t rate = 29'970;
  std::uint64_t unfit = 0;
  Duration since_last_set;
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
  EXPECT_NE(judged().problem.find("heads 'left', 'right' are not there: unplugged"), std::string::npos)
      << judged().problem;
}

TEST_F(HealthTest, AHeadAway_IsDegradedAndNamesIt) {
  capture.heads[1].present = false;
  capture.heads[1].problem = "unplugged";
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_EQ(judged().problem, "head 'right' is not there: unplugged");
}

TEST_F(HealthTest, GenlockLost_IsDegradedAndSaysSo) {
  capture.genlock.state = GenlockState::kLost;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("genlock is lost"), std::string::npos);
}

TEST_F(HealthTest, TooSlow_IsDegradedWithBothRates) {
  rate = 28'500;
  EXPECT_EQ(judged().state, "running") << "within a twentieth";
  rate = 20'120;
  EXPECT_EQ(judged().state, "degraded");
  EXPECT_NE(judged().problem.find("20.12 raymaps a second are made of the rig's 29.97"), std::string::npos)
      << judged().problem;
}

TEST_F(HealthTest, FramesThatDoNotFitTheCalibration_AreAProblem) {
  unfit = 1;
  EXPECT_EQ(judged().state, "degraded");
}

TEST(ProgressMonitor, AStageThatHangs_IsNamedAndTheWatchdogGoesHungry) {
  hal::sim::SimClock clock;
  hal::sim::SimWatchdog watchdog(clock);
  ProgressMonitor monitor(&watchdog);
  const Health fine{"running", ""};
  std::uint64_t progress = 0;
  const auto seconds = [&](int n, bool moving, bool may_rest) {
    for (int i = 0; i < n * 10; ++i) {
      if (moving) ++progress;
      monitor.step({{"capture", static_cast<std::uint64_t>(clock.now().ns()), false}, {"blend", progress, may_rest}},
                   fine, clock.now());
      clock.advance(Duration::milliseconds(100));
    }
  };
  seconds(20, true, false);
  EXPECT_TRUE(watchdog.is_ready());
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1)));
  seconds(60, false, true);
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1))) << "nothing to do is not hanging";
  seconds(15, false, false);
  EXPECT_EQ(monitor.stuck(), "blend");
  EXPECT_TRUE(watchdog.would_bite(Duration::seconds(5)));
  EXPECT_EQ(watchdog.lines().back(), "blend hangs");
  seconds(2, true, false);
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(1)));
}

}  // namespace
}  // namespace nodal::firmware
