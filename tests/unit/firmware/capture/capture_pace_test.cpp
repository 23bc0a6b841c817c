#include "firmware/capture/capture_pace.h"

#include <gtest/gtest.h>

#include <vector>

#include "hal/sim/clock.h"
#include "hal/sim/trigger.h"

namespace nodal::firmware {
namespace {

constexpr FrameRate kSlow{10, 1}, kFast{25, 1};

RigConfig rig(SyncSource source) {
  RigConfig config;
  config.rate = kSlow;
  config.trigger.source = source;
  config.heads.resize(2);
  return config;
}

class CapturePaceTest : public testing::Test {
 protected:
  CapturePace pace(hal::TriggerPort* port, SyncSource source = SyncSource::kOwn) {
    return CapturePace(rig(source), port, [this](Instant) { ++closed_; });
  }
  hal::sim::SimClock clock_;
  hal::sim::SimTrigger trigger_{clock_, {}, 1};
  int closed_ = 0;  ///< how often all open sets were closed
  const Instant now_ = Instant() + Duration::seconds(1);
};

TEST_F(CapturePaceTest, StartedAndStopped_HeadsChangeModeAndOpenSetsAreClosedEachTime) {
  CapturePace pace = this->pace(&trigger_);
  EXPECT_EQ(pace.mode(), hal::TriggerMode::kFreeRun);
  ASSERT_TRUE(pace.start({kFast, {}}, now_));
  EXPECT_TRUE(trigger_.running());
  EXPECT_EQ(pace.mode(), hal::TriggerMode::kExternal);
  EXPECT_EQ(pace.timing().period(), kFast.period());
  EXPECT_EQ(closed_, 1);
  pace.stop(now_);
  EXPECT_FALSE(trigger_.running());
  EXPECT_EQ(pace.mode(), hal::TriggerMode::kFreeRun);
  EXPECT_EQ(pace.timing().period(), kSlow.period()) << "rig.toml's rate again";
  EXPECT_EQ(closed_, 2);
}

TEST_F(CapturePaceTest, StoppedInFreeRun_OpenSetsStayOpen) {
  CapturePace pace = this->pace(&trigger_);
  pace.stop(now_);
  EXPECT_EQ(closed_, 0);
}

TEST_F(CapturePaceTest, TheTriggerRefuses_HeadsRunFreeAtTheRateOfTheConfiguration) {
  trigger_.unplug();
  CapturePace pace = this->pace(&trigger_);
  EXPECT_EQ(pace.start({kFast, {}}, now_).error().code, Errc::kDeviceGone);
  EXPECT_EQ(pace.mode(), hal::TriggerMode::kFreeRun);
  EXPECT_EQ(pace.timing().period(), kSlow.period());
  EXPECT_EQ(pace.report().rate.period(), kSlow.period());
}

TEST_F(CapturePaceTest, WithoutATrigger_HeadsAreAlignedAtTheRateOfTheConfigurationAndAtNoOther) {
  CapturePace pace = this->pace(nullptr, SyncSource::kNone);
  EXPECT_EQ(pace.start({kFast, {}}, now_).error().code, Errc::kUnsupported);
  EXPECT_EQ(pace.start({{}, Duration::milliseconds(1)}, now_).error().code, Errc::kUnsupported);
  ASSERT_TRUE(pace.start({kSlow, {}}, now_));
  EXPECT_EQ(pace.mode(), hal::TriggerMode::kFreeRun);
  EXPECT_TRUE(pace.report().aligned);
  EXPECT_EQ(closed_, 0);
}

}  // namespace
}  // namespace nodal::firmware
