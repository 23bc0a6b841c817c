// A trace of GPIO lines shows every claim, level and edge.
#include <cerrno>

#include "gpio_fixture.h"
#include "hal/linux/gpio/traced_system.h"

namespace nodal::hal::gpio {
namespace {

class GpioTrace : public GpioTest {
 protected:
  bool has(const std::string& part) const { return text_.find(part) != std::string::npos; }

  std::string text_;
  TracedSystem traced_{chips_, [this](const std::string& line) { text_ += line + "\n"; }};
};

TEST_F(GpioTrace, LineThatIsDrivenAndReadBack_EveryLevelAndEdgeIsWritten) {
  chips_.connect(line(17), line(22));
  Claim out = traced_.claim_output(line(17), false);
  Claim in = traced_.claim_input(line(22), {});
  ASSERT_TRUE(out.line && in.line);
  EXPECT_EQ(out.line->set(true), 0);
  std::array<LineEvent, kKernelQueue> events;
  EXPECT_EQ(in.line->read_events(events), 1);
  EXPECT_EQ(in.line->get(), 1);
  out.line.reset();
  EXPECT_EQ(chips_.claimed(), 1) << "the line was released";
  EXPECT_TRUE(has("gpio:gpiochip0:17: claimed as an output, low\n")) << text_;
  EXPECT_TRUE(has("gpio:gpiochip0:22: claimed as an input, active when it is high\n")) << text_;
  EXPECT_TRUE(has("gpio:gpiochip0:17: set high\n")) << text_;
  EXPECT_TRUE(has("gpio:gpiochip0:22: rising edge at ")) << text_;
  EXPECT_TRUE(has("gpio:gpiochip0:22: is high\n")) << text_;
  EXPECT_TRUE(has("gpio:gpiochip0:17: released\n")) << text_;
}

TEST_F(GpioTrace, RefusedClaimAndWrite_AreWrittenWithTheReason) {
  chips_.hold(line(5), "another");
  EXPECT_EQ(traced_.claim_output(line(5), true).error, EBUSY);
  EXPECT_TRUE(has("gpio:gpiochip0:5: cannot be claimed as an output, high -> Device or resource busy\n")) << text_;
  const Claim out = traced_.claim_output(line(6), false);
  ASSERT_TRUE(out.line);
  chips_.before_set = [](const LineName&, bool) { return EIO; };
  EXPECT_EQ(out.line->set(true), EIO);
  EXPECT_TRUE(has("gpio:gpiochip0:6: set high -> Input/output error\n")) << text_;
}

}  // namespace
}  // namespace nodal::hal::gpio
