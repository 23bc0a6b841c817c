// The trigger input of an IIDC head.
#include "head_fixture.h"

namespace nodal::hal::iidc {
namespace {

TEST_F(IidcHeadTest, TriggerModes_AreInTheRegisterWithThePolarityBeforeItTransmits) {
  for (const bool pulse_width : {false, true}) {
    for (const bool active_high : {false, true}) {
      request_.trigger = {pulse_width, active_high};
      request_.pulse_width = Duration::microseconds(700);
      const auto head = streaming(TriggerMode::kExternal);
      EXPECT_TRUE(bus_.transmits());
      EXPECT_EQ(bus_.registers.get(0x830) & 0x03FF'0000,
                kOnBit | (active_high ? kHighBit : 0) | (pulse_width ? 0x0001'0000U : 0U));
    }
  }
}

TEST_F(IidcHeadTest, Pulses_ExposeOneFrameEachAndStoppingThemSwitchesTheTriggerOff) {
  trigger_.connect(0, &bus_);
  const auto head = streaming(TriggerMode::kExternal);
  pass(period_ * 5);
  EXPECT_EQ(bus_.frames_exposed(), 0U);
  TriggerSettings settings;
  settings.rate = {20, 1};
  ASSERT_TRUE(trigger_.start(settings));
  std::vector<FrameView> frames;
  for (int i = 0; i < 10; ++i) frames.push_back(pass_frame(*head));
  trigger_.stop();
  for (const FrameView& frame : frames) {
    const auto pulse = *trigger_.take_edge();
    ASSERT_TRUE(pulse);
    EXPECT_EQ(frame.sequence, pulse->number);
    EXPECT_EQ(frame.mid_exposure - frame.in_effect.exposure.duration() / 2, pulse->at);
  }
  head->stop();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  pass_frame(*head);
  EXPECT_FALSE(bus_.triggered());
}

TEST_F(IidcHeadTest, ThePulseAsExposure_IsTheOnlyExposureAndInFreeRunTheShutterIs) {
  request_.trigger.pulse_width = true;
  request_.pulse_width = Duration::microseconds(700);
  trigger_.connect(0, &bus_);
  auto head = streaming(TriggerMode::kExternal);
  EXPECT_EQ(head->limits().exposure_min, Exposure::microseconds(700));
  EXPECT_EQ(head->limits().exposure_max, Exposure::microseconds(700));
  TriggerSettings settings;
  settings.rate = {20, 1};
  ASSERT_TRUE(trigger_.start(settings));
  EXPECT_EQ(pass_frame(*head).in_effect.exposure, Exposure::microseconds(700));
  trigger_.stop();
  head->stop();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  EXPECT_EQ(pass_frame(*head).in_effect.exposure, Exposure::microseconds(15'100));
}

TEST_F(IidcHeadTest, ATriggerModeThatItDoesNotHave_IsUnsupported) {
  bus_.registers.set(0x530, bus_.registers.get(0x530) & ~0x4000U);  // no mode 1
  EXPECT_TRUE(opened()->limits().has_trigger_input);
  request_.trigger.pulse_width = true;
  const auto head = opened();
  EXPECT_FALSE(head->limits().has_trigger_input);
  const Status started = head->start(TriggerMode::kExternal);
  ASSERT_FALSE(started);
  expect_says(started.error(), Errc::kUnsupported, "no trigger input of this mode");
}

TEST_F(IidcHeadTest, APolarityThatCannotBeSet_MustBeTheCameras) {
  bus_.registers.set(0x530, bus_.registers.get(0x530) & ~kOnBit);  // no polarity; the register says low
  auto head = streaming(TriggerMode::kExternal);
  const auto frame = next(*head);
  ASSERT_FALSE(frame);
  expect_says(frame.error(), Errc::kUnsupported, "active low and cannot be changed");
  head.reset();
  request_.trigger.active_high = false;
  head = streaming(TriggerMode::kExternal);
  EXPECT_TRUE(bus_.transmits());
}

TEST_F(IidcHeadTest, ATriggerThatStaysOff_IsAnErrorOfTheStart) {
  bus_.ignore_writes(0x830);
  const auto head = streaming(TriggerMode::kExternal);
  const auto frame = next(*head);
  ASSERT_FALSE(frame);
  expect_says(frame.error(), Errc::kDeviceFailed, "setting its trigger");
  EXPECT_FALSE(bus_.transmits());
}

}  // namespace
}  // namespace nodal::hal::iidc
