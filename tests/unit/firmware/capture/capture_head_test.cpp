// One head of the capture stage, on a port that the test scripts.
#include "firmware/capture/capture_head.h"

#include <gtest/gtest.h>

namespace nodal::firmware {
namespace {

constexpr Duration kPeriod = Duration::milliseconds(40);

hal::HeadLimits limits_with_gamma() {
  hal::HeadLimits limits;
  limits.exposure_min = Exposure::microseconds(100);
  limits.exposure_max = Exposure::microseconds(20'000);
  limits.gain_max = Gain::millidecibels(24'000);
  limits.has_white_balance = true;
  limits.gamma_min = hal::Gamma::thousandths(500);
  limits.gamma_max = hal::Gamma::thousandths(2500);
  limits.control_latency_frames = 2;
  return limits;
}

/// Streams nothing; notes what is requested of it.
class ScriptedPort final : public hal::HeadPort {
 public:
  explicit ScriptedPort(const hal::HeadLimits& limits) : limits_(limits) {}
  const hal::HeadIdentity& identity() const override { return identity_; }
  const hal::HeadFormat& format() const override { return format_; }
  const hal::HeadLimits& limits() const override { return limits_; }
  Status start(hal::TriggerMode) override { return {}; }
  void stop() override {}
  Status set_exposure(Exposure) override { return {}; }
  Status set_gain(Gain) override { return {}; }
  Status set_white_balance(WhiteBalance) override { return {}; }
  Status set_gamma(hal::Gamma) override { return {}; }
  Status nudge(Duration) override { return {}; }
  Result<std::optional<hal::FrameView>> take_frame() override { return std::optional<hal::FrameView>(); }
  void add_wake_ups(hal::WakeUps&) const override {}
  void release(hal::BufferSlot) override {}

 private:
  const hal::HeadIdentity identity_;
  const hal::HeadFormat format_;
  const hal::HeadLimits limits_;
};

class ScriptedEnumerator final : public hal::HeadEnumerator {
 public:
  bool present = true;
  hal::HeadLimits limits = limits_with_gamma();

  Result<std::unique_ptr<hal::HeadPort>> open(const std::string&) override {
    if (!present) return fail(Errc::kNoSuchDevice, "nothing is connected");
    return std::make_unique<ScriptedPort>(limits);
  }
  std::vector<hal::HeadIdentity> list() override { return {}; }
};

HeadConfig config() {
  HeadConfig head;
  head.name = "cam0";
  return head;
}

class CaptureHeadTest : public testing::Test {
 protected:
  void step() {
    now = now + Duration::seconds(1);
    head.step(now, hal::TriggerMode::kFreeRun);
  }
  static SettingsChange gamma(std::int32_t thousandths) {
    SettingsChange change;
    change.gamma = hal::Gamma::thousandths(thousandths);
    return change;
  }

  Instant now;
  ScriptedEnumerator enumerator;
  CaptureHead head{config(), "test:cam0", enumerator};
};

TEST_F(CaptureHeadTest, NotStreaming_MissesSetsWithoutBeingReportedForThem) {
  enumerator.present = false;
  step();
  for (int set = 0; set < 1000; ++set) head.missed_set(kPeriod);
  EXPECT_EQ(head.report().missing_sets, 1000U);
  EXPECT_FALSE(head.report().in_no_set) << "it is missing, which its problem says";
}

TEST_F(CaptureHeadTest, Streaming_IsReportedAfterTwoSecondsOfSetsWithoutIt) {
  step();
  step();
  ASSERT_TRUE(head.streaming());
  for (int set = 0; set < 49; ++set) head.missed_set(kPeriod);
  EXPECT_FALSE(head.report().in_no_set);
  head.missed_set(kPeriod);
  EXPECT_TRUE(head.report().in_no_set) << "50 sets at 25 a second";
}

TEST_F(CaptureHeadTest, StreamingAtALowRate_IsReportedAfterFourSets) {
  step();
  step();
  for (int set = 0; set < 3; ++set) head.missed_set(Duration::seconds(1000));
  EXPECT_FALSE(head.report().in_no_set);
  head.missed_set(Duration::seconds(1000));
  EXPECT_TRUE(head.report().in_no_set);
}

TEST_F(CaptureHeadTest, GammasInAndOutOfItsRange_AreAllowedAndRefused) {
  step();
  for (const std::int32_t allowed : {500, 1000, 2500}) EXPECT_TRUE(head.check(gamma(allowed))) << allowed;
  EXPECT_TRUE(head.check(gamma(0))) << "its own curve";
  for (const std::int32_t refused : {499, 2501}) {
    const Status checked = head.check(gamma(refused));
    ASSERT_FALSE(checked) << refused;
    EXPECT_EQ(checked.error().code, Errc::kBadValue);
    EXPECT_NE(checked.error().message.find("; allowed are 500/1000 to 2500/1000"), std::string::npos);
  }
}

TEST_F(CaptureHeadTest, AnExposureWithOneAllowedValue_CannotBeChangedAndTheErrorSaysSo) {
  enumerator.limits.exposure_min = enumerator.limits.exposure_max = Exposure::microseconds(10'000);
  step();
  SettingsChange change;
  change.exposure = Exposure::microseconds(8000);
  const Status checked = head.check(change);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, Errc::kBadValue);
  EXPECT_NE(checked.error().message.find("its exposure cannot be changed; it is 10000 us"), std::string::npos)
      << checked.error().message;
}

TEST_F(CaptureHeadTest, WithoutAGamma_OnlyItsOwnCurveIsAllowed) {
  enumerator.limits.gamma_min = enumerator.limits.gamma_max = hal::Gamma();
  step();
  EXPECT_TRUE(head.check(gamma(0)));
  const Status checked = head.check(gamma(1000));
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, Errc::kUnsupported);
}

}  // namespace
}  // namespace nodal::firmware
