// Lamps and buttons.
#include "hal/linux/gpio/pins.h"

#include <cerrno>

#include "gpio_fixture.h"

namespace nodal::hal::gpio {
namespace {

class GpioPinsTest : public GpioTest {
 protected:
  void add_pins() {
    lamp_ = pins_.add_output({line(4)}).value();
    button_ = pins_.add_input({line(5)}).value();
    if (!pins_.start()) throw std::runtime_error("no thread");
  }
  std::vector<PinEdge> edges() {
    std::vector<PinEdge> all;
    while (const auto edge = button_->take_edge().value()) all.push_back(*edge);
    return all;
  }
  Pins pins_{chips_};
  GpioOutputPin* lamp_ = nullptr;
  GpioInputPin* button_ = nullptr;
};

TEST_F(GpioPinsTest, NobodySteps_TheLeaseEndsAllTheSame) {
  add_pins();
  ASSERT_TRUE(lamp_->set(true, chips_.now(), Duration::milliseconds(50)));
  chips_.pass(Duration::milliseconds(49));
  EXPECT_TRUE(chips_.wire(line(4)));
  chips_.pass(Duration::milliseconds(1));
  EXPECT_FALSE(chips_.wire(line(4)));
}

TEST_F(GpioPinsTest, BurstOfMoreEdgesThanTheKernelKeeps_TheLevelAfterItIsReported) {
  add_pins();
  for (const int edges_in_burst :
       {15, 16, 17, 40, 41, -15, -16, -17, -40, -41}) {  // negative: the oldest are discarded
    chips_.discards_oldest = edges_in_burst < 0;
    std::vector<bool> levels;
    bool high = chips_.wire(line(5));
    for (int i = 0; i < std::abs(edges_in_burst); ++i) levels.push_back(high = !high);
    chips_.drive_burst(line(5), levels);
    chips_.pass(Duration::milliseconds(10));
    const auto all = edges();
    ASSERT_FALSE(all.empty()) << edges_in_burst;
    EXPECT_EQ(all.back().high, high) << edges_in_burst;
    EXPECT_EQ(button_->level().value(), high) << edges_in_burst;
    for (std::size_t i = 1; i < all.size(); ++i) {
      EXPECT_NE(all[i].high, all[i - 1].high);
      EXPECT_GT(all[i].at, all[i - 1].at);
    }
  }
  EXPECT_GT(chips_.discarded_edges(), 0U);
  EXPECT_EQ(button_->bursts(), 8U);
}

TEST_F(GpioPinsTest, NobodyTakesEdges_TheLastLevelComesWhenThereIsRoom) {
  add_pins();
  for (int i = 0; i < 301; ++i) {
    chips_.drive(line(5), i % 2 == 0);
    chips_.pass(Duration::milliseconds(1));
  }
  EXPECT_EQ(edges().size(), GpioInputPin::kEdgesKept);
  chips_.pass(Duration::milliseconds(100));
  const auto late = edges();
  ASSERT_EQ(late.size(), 1U);
  EXPECT_TRUE(late[0].high);
  EXPECT_GT(button_->bursts(), 0U);
}

TEST_F(GpioPinsTest, ButtonHeldFromTheStart_IsNoPress) {
  chips_.drive(line(5), true);
  add_pins();
  chips_.pass(Duration::milliseconds(100));
  EXPECT_TRUE(edges().empty());
  EXPECT_TRUE(button_->level().value());
}

TEST_F(GpioPinsTest, ButtonThatPullsItsLineLow_IsPressedWhenTheLineIsLow) {
  chips_.drive(line(7), true);
  GpioInputPin* const button = pins_.add_input({line(7), true, Bias::kPullUp}).value();
  ASSERT_TRUE(pins_.start());
  chips_.drive(line(7), false);
  const auto edge = button->take_edge().value();
  ASSERT_TRUE(edge);
  EXPECT_TRUE(edge->high);
  EXPECT_TRUE(button->level().value());
}

TEST_F(GpioPinsTest, WriteRefusedOnce_TheLampIsWrittenAgain) {
  add_pins();
  chips_.before_set = [left = 1](const LineName&, bool) mutable { return left-- > 0 ? EIO : 0; };
  ASSERT_TRUE(lamp_->set(true, chips_.now(), Duration::milliseconds(500)));
  chips_.pass(Duration::milliseconds(30));
  EXPECT_TRUE(chips_.wire(line(4)));
  EXPECT_TRUE(lamp_->step(chips_.now()));
}

TEST_F(GpioPinsTest, WritesRefused_TheLampFailsAndTheButtonWorks) {
  add_pins();
  chips_.before_set = [](const LineName&, bool) { return EIO; };
  ASSERT_TRUE(lamp_->set(true, chips_.now(), Duration::milliseconds(500)));
  chips_.pass(Duration::milliseconds(400));
  const Status status = lamp_->step(chips_.now());
  ASSERT_FALSE(status);
  expect_says(status.error(), Errc::kDeviceFailed, {"gpio:gpiochip0:4", "dmesg"});
  chips_.drive(line(5), true);
  EXPECT_EQ(edges().size(), 1U);
  chips_.before_set = nullptr;
}

TEST_F(GpioPinsTest, ChipGone_BothSaySo) {
  add_pins();
  ASSERT_TRUE(lamp_->set(true, chips_.now(), Duration::seconds(500)));
  chips_.unplug("gpiochip0");
  EXPECT_EQ(button_->take_edge().error().code, Errc::kDeviceGone);
  ASSERT_TRUE(lamp_->set(false, chips_.now(), Duration::seconds(500)));
  EXPECT_EQ(lamp_->step(chips_.now()).error().code, Errc::kDeviceGone);
}

TEST_F(GpioPinsTest, LongestLease_DoesNotOverflow) {
  add_pins();
  ASSERT_TRUE(lamp_->set(true, chips_.now(), Duration::nanoseconds(INT64_MAX)));
  chips_.pass(Duration::seconds(1'000'000));
  EXPECT_TRUE(chips_.wire(line(4)));
}

TEST_F(GpioPinsTest, ThreadRefused_IsAnErrorAndLinesAreReleased) {
  {
    Pins pins(chips_);
    ASSERT_TRUE(pins.add_output({line(4)}));
    chips_.refuse_threads = true;
    const Status status = pins.start();
    ASSERT_FALSE(status);
    expect_says(status.error(), Errc::kOverload, {"TasksMax"});
  }
  EXPECT_EQ(chips_.claimed(), 0);
}

}  // namespace
}  // namespace nodal::hal::gpio
