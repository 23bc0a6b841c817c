// GPIO lines in rig.toml.
#include <gtest/gtest.h>

#include "firmware/config/config.h"

namespace nodal::firmware {
namespace {

/// Two V4L2 heads; `first` and `second` are additional keys for them.
std::string rig(const std::string& trigger, const std::string& first = "", const std::string& second = "") {
  return "[rig]\nname='r'\n[trigger]\n" + trigger + "\n[[heads]]\nname='a'\nport='sim:a'\n" + first +
         "\n[[heads]]\nname='b'\nport='sim:b'\n" + second + "\n[sim]\ncalibration='truth.json'\n";
}

void expect_refused(const std::string& text, const std::vector<std::string>& parts) {
  const auto config = parse_rig_config(text, "rig.toml");
  ASSERT_FALSE(config) << text;
  for (const std::string& part : parts) {
    EXPECT_NE(config.error().message.find(part), std::string::npos) << config.error().message << "\nlacks: " << part;
  }
}

TEST(GpioConfig, LinesOfTriggerAndPanel_AreReadWithTheirOptions) {
  const auto config = parse_rig_config(
      rig("port='gpio:gpiochip0:17'\nreadback='gpio:pinctrl-bcm2711:27'", "", "trigger='gpio:INT34BB:00:3'") +
          "[panel]\nbutton='gpio:gpiochip1:0,low,pull-up'\nstatus='gpio:gpiochip1:1'\ntally='gpio:gpiochip1:2,low'\n",
      "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->trigger.port, (GpioLine{"gpiochip0", 17, false, GpioPull::kNone}));
  EXPECT_EQ(config->trigger.readback, (GpioLine{"pinctrl-bcm2711", 27, false, GpioPull::kNone}));
  EXPECT_EQ(config->heads[0].trigger, std::nullopt);
  EXPECT_EQ(config->heads[1].trigger, (GpioLine{"INT34BB:00", 3, false, GpioPull::kNone}));
  EXPECT_EQ(config->panel.button_line, (GpioLine{"gpiochip1", 0, true, GpioPull::kUp}));
  EXPECT_EQ(config->panel.status_line, (GpioLine{"gpiochip1", 1, false, GpioPull::kNone}));
  EXPECT_EQ(config->panel.tally_line, (GpioLine{"gpiochip1", 2, true, GpioPull::kNone}));
}

TEST(GpioConfig, InputToFollow_MayHaveAPull) {
  const auto config = parse_rig_config(rig("source='external'\nport='gpio:gpiochip0:5,pull-down'"), "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->trigger.port->pull, GpioPull::kDown);
  expect_refused(rig("port='gpio:gpiochip0:5,pull-down'"), {"pull", "inputs only"});
}

TEST(GpioConfig, OddText_IsRefusedWithTheForm) {
  for (const char* const text : {"17",
                                 "gpio:",
                                 "gpio:17",
                                 "gpio::17",
                                 "gpio:chip:",
                                 "gpio:chip:-1",
                                 "gpio:chip:+1",
                                 "gpio:chip:1 ",
                                 "gpio:chip: 1",
                                 "gpio:chip:65536",
                                 "gpio:chip:4294967297",
                                 "gpio:chip:99999999999999999999",
                                 "gpio:chip:0x11",
                                 "gpio:chip:17,",
                                 "gpio:chip:17,,",
                                 "gpio:chip:17,low",
                                 "gpio:chip:17,LOW",
                                 "gpio:chip:17;low",
                                 "gpio:../mem:1",
                                 "gpio:/dev/gpiochip0:1",
                                 "gpio:chip\\u0000:1",
                                 "gpio:chip\\n:1",
                                 "gpio:ch\\u00efp:1",
                                 "GPIO:chip:1",
                                 "gpio:a-label-that-is-longer-than-31-by:1",
                                 "sim:"}) {
    expect_refused(rig("port=\"" + std::string(text) + "\""), {"trigger.port must be gpio:CHIP:LINE", "gpiochip0:17"});
  }
  for (const char* const text : {"gpio:c:1,low,low", "gpio:c:1,pull-up,pull-down", "gpio:3"}) {
    expect_refused(rig("") + "[panel]\nbutton='" + text + "'\n", {"panel.button must be sim:", "gpio:CHIP:LINE[,low]"});
  }
  expect_refused(rig("") + "[panel]\ntally='gpio:c:1,pull-up'\n", {"panel.tally must be"});
}

TEST(GpioConfig, LineUsedTwice_NamesBothKeys) {
  expect_refused(rig("port='gpio:c:1'\nreadback='gpio:c:1'"), {"gpio:c:1 twice", "trigger.port", "trigger.readback"});
  expect_refused(rig("port='gpio:c:1'", "", "trigger='gpio:c:1'"), {"twice", "trigger.port", "trigger of head 'b'"});
  expect_refused(rig("port='gpio:c:1'") + "[panel]\nstatus='gpio:c:1,low'\n", {"twice", "panel.status"});
  expect_refused(rig("") + "[panel]\nstatus='gpio:c:1'\ntally='gpio:c:1'\n", {"twice", "panel.tally"});
  EXPECT_TRUE(parse_rig_config(rig("", "trigger='gpio:c:1'", "trigger='gpio:c:1'"), "rig.toml"));
}

TEST(GpioConfig, DelaysThatDifferOnOneLine_AreRefusedWithBothHeads) {
  expect_refused(rig("port='gpio:c:1'", "", "trigger_delay_us=200"), {"'a' and 'b'", "gpio:c:1", "0 and 200"});
  expect_refused(rig("", "trigger='gpio:c:1'", "trigger='gpio:c:1'\ntrigger_delay_us=200"), {"'a' and 'b'"});
  EXPECT_TRUE(parse_rig_config(rig("port='gpio:c:1'", "", "trigger='gpio:c:2'\ntrigger_delay_us=200"), "rig.toml"));
  const std::string wired = "trigger_mode='wired'\ntrigger_delay_us=200";
  EXPECT_TRUE(parse_rig_config(rig("port='gpio:c:1'", "", wired), "rig.toml"))
      << "the delay of a wired head is its own";
  EXPECT_TRUE(parse_rig_config(rig("port='gpio:c:1'", wired, "trigger_delay_us=300"), "rig.toml"));
}

TEST(GpioConfig, LinesThatDoNotFitTheSource_AreRefused) {
  expect_refused(rig("source='none'\nport='gpio:c:1'"), {"source = \"none\""});
  expect_refused(rig("source='external'\nport='gpio:c:1'", "trigger='gpio:c:2'"), {"source = \"external\""});
  expect_refused(rig("source='external'\nport='gpio:c:1'\nreadback='gpio:c:2'"), {"source = \"external\""});
  expect_refused(rig("", "trigger='gpio:c:2'"), {"head 'b' has none"});
  expect_refused(rig("readback='gpio:c:2'", "trigger='gpio:c:1'", "trigger='gpio:c:1'"), {"readback without a port"});
  expect_refused(rig("port='gpio:c:1'\npulse_width_us=33300"), {"pulse_width_us", "100 us"});
  expect_refused(rig("port='gpio:c:1'") + "clock='fast'\n", {"clock = \"fast\"", "trigger.port"});
}

}  // namespace
}  // namespace nodal::firmware
