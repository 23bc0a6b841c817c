// Lines that do not exist, are held, fail or hang.
#include <cerrno>
#include <chrono>

#include "gpio_fixture.h"

namespace nodal::hal::gpio {
namespace {

using GpioTroubleTest = GpioTest;

TEST_F(GpioTroubleTest, ClaimRefused_TheMessageNamesTheLineAndWhatToDo) {
  add_output(17, {0});
  lines_.outputs[0].line.chip = "gpiochip9";
  expect_says(open_error(), Errc::kNoSuchDevice, {"gpio:gpiochip9:17", "gpiochip0 (pinctrl-main)", "rig.toml"});
  lines_.outputs[0].line = line(32);
  expect_says(open_error(), Errc::kNoSuchDevice, {"no line 32", "gpiochip0"});
  lines_.outputs[0].line = line(17);
  chips_.hold(line(17), "spi0 CS0");
  expect_says(open_error(), Errc::kBusy, {"gpio:gpiochip0:17", "held by 'spi0 CS0'", "gpioinfo"});
  chips_.hold(line(17), "");
  chips_.claim_error["gpio:gpiochip0:17"] = EACCES;
  expect_says(open_error(), Errc::kDeviceFailed, {"gpio:gpiochip0:17", "group gpio", "udev"});
  EXPECT_EQ(chips_.claimed(), 0);
}

TEST_F(GpioTroubleTest, LineTwiceByNameAndByLabel_IsHeldByNodaldItself) {
  add_output(17, {0});
  lines_.outputs.emplace_back().line = {"pinctrl-main", 17};
  expect_says(open_error(), Errc::kBusy, {"gpio:pinctrl-main:17", "held by 'nodald'", "twice"});
  EXPECT_EQ(chips_.claimed(), 0);
}

TEST_F(GpioTroubleTest, ThreadRefused_IsAnErrorAndLinesAreReleased) {
  add_output(17, {0});
  chips_.refuse_threads = true;
  expect_says(open_error(), Errc::kOverload, {"trigger", "thread", "TasksMax"});
  EXPECT_EQ(chips_.claimed(), 0);
}

TEST_F(GpioTroubleTest, RealTimePriorityRefused_ItWorksAndANoticeSaysSo) {
  add_output(17, {0});
  chips_.refuse_realtime = true;
  open();
  EXPECT_FALSE(trigger_->notice().empty());
  start({});
  EXPECT_EQ(edges_during(Duration::seconds(1)).size(), 30U);
}

TEST_F(GpioTroubleTest, SomeWritesRefused_EachCostsOnePulseAndIsCounted) {
  add_output(17, {0});
  open();
  chips_.before_set = [write = 0](const LineName&, bool high) mutable { return high && ++write % 5 == 0 ? EIO : 0; };
  start({});
  const auto all = edges_during(Duration::seconds(1));
  EXPECT_EQ(all.size(), 24U);
  EXPECT_EQ(all.back().number, 28U);
  EXPECT_EQ(trigger_->counts().refused, 6U);
}

TEST_F(GpioTroubleTest, EveryWriteRefused_TheTriggerFailsAndStartsAgainWhenTheLineWorks) {
  add_output(17, {0});
  open();
  chips_.before_set = [](const LineName&, bool) { return EIO; };
  start({});
  chips_.pass(Duration::seconds(1));
  const auto edge = trigger_->take_edge();
  ASSERT_FALSE(edge);
  expect_says(edge.error(), Errc::kDeviceFailed, {"trigger", "gpio:gpiochip0:17"});
  chips_.before_set = nullptr;
  start({});
  EXPECT_EQ(edges_during(Duration::seconds(1)).size(), 30U);
}

TEST_F(GpioTroubleTest, FallRefused_IsTriedAgainSoThatTheLineDoesNotStayActive) {
  add_output(17, {0});
  open();
  chips_.before_set = [refused = 0](const LineName&, bool high) mutable { return !high && refused++ == 0 ? EIO : 0; };
  start({});
  chips_.pass(Duration::milliseconds(2));
  EXPECT_FALSE(chips_.wire(line(17)));
  EXPECT_EQ(edges_during(Duration::seconds(1)).size(), 31U);
}

TEST_F(GpioTroubleTest, ChipGone_IsFinalForTheTrain) {
  add_output(17, {0});
  open();
  start({});
  edges_during(Duration::milliseconds(100));
  chips_.unplug("gpiochip0");
  chips_.pass(Duration::milliseconds(100));
  const auto edge = trigger_->take_edge();
  ASSERT_FALSE(edge);
  expect_says(edge.error(), Errc::kDeviceGone, {"gpio:gpiochip0:17"});
}

// A write blocks, but the calls of capture's thread and of the program's end return. Other lines are made safe.
TEST_F(GpioTroubleTest, WriteHangs_NoCallWaitsForIt) {
  chips_.threads = true;
  add_output(17, {0});
  add_output(18, {1});
  open();
  TriggerSettings settings;
  settings.pulse_width = Duration::milliseconds(5);
  settings.delay[0] = Duration::milliseconds(2);
  start(settings);
  chips_.pass(Duration::milliseconds(2));
  ASSERT_TRUE(chips_.wire(line(18)));
  chips_.hang(line(17));
  chips_.pass(Duration::milliseconds(50));
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_LE(edges().size(), 1U);
  trigger_->stop();
  EXPECT_TRUE(trigger_->start(settings));
  EXPECT_TRUE(edges().empty());
  trigger_->make_safe();
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::milliseconds(500));
  EXPECT_FALSE(chips_.wire(line(18)));
  chips_.unhang();
  trigger_.reset();
  EXPECT_FALSE(chips_.wire(line(17)));
}

}  // namespace
}  // namespace nodal::hal::gpio
