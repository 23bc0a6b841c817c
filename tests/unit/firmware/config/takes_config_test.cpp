// [takes] of rig.toml, and how a head's pictures are stored.
#include <gtest/gtest.h>

#include <string>

#include "firmware/config/config.h"

namespace nodal::firmware {
namespace {

std::string rig_with_takes(const std::string& head, const std::string& takes) {
  return "[rig]\nname = \"r\"\n[takes]\n" + takes +
         "[[heads]]\nname = \"a\"\nport = \"replay:a.png\"\n[[heads]]\nname = \"b\"\nport = \"replay:b.png\"\n" + head;
}
const std::string kTakesFolder = "folder = \"takes\"\n";

RigConfig parsed_takes(const std::string& text) {
  const auto config = parse_rig_config(text, "rig.toml");
  EXPECT_TRUE(config) << config.error().text();
  return config.value_or(RigConfig());
}
void expect_takes_refused(const std::string& text, const std::string& why) {
  const auto config = parse_rig_config(text, "rig.toml");
  ASSERT_FALSE(config);
  EXPECT_NE(config.error().message.find(why), std::string::npos) << config.error().message;
}

TEST(TakesConfig, ATake_EndsOrLoopsOnAFullDisk) {
  const RigConfig usual = parsed_takes(rig_with_takes("", kTakesFolder));
  ASSERT_TRUE(usual.takes);
  EXPECT_EQ(usual.takes->folder, "takes");
  EXPECT_FALSE(usual.takes->loop);
  EXPECT_FALSE(usual.takes->at_start);
  const RigConfig loop = parsed_takes(rig_with_takes("", kTakesFolder + "when_full = \"loop\"\nstart = \"boot\"\n"));
  EXPECT_TRUE(loop.takes->loop);
  EXPECT_TRUE(loop.takes->at_start);
  EXPECT_FALSE(parsed_takes(rig_with_takes("", kTakesFolder + "when_full = \"stop\"\n")).takes->loop);
  expect_takes_refused(rig_with_takes("", kTakesFolder + "when_full = \"delete\"\n"), "allowed is one of stop, loop");
  expect_takes_refused(rig_with_takes("", ""), "takes.folder");
}

TEST(TakesConfig, AHead_IsStoredAsItSaysOrElseAsTheTakeSays) {
  EXPECT_EQ(parsed_takes(rig_with_takes("", kTakesFolder)).heads[0].take_mode, TakeMode::kDriver);
  const RigConfig config =
      parsed_takes(rig_with_takes("take_mode = \"jpeg\"\n", kTakesFolder + "mode = \"raw\"\nquality = 80\n"));
  EXPECT_EQ(config.heads[0].take_mode, TakeMode::kRaw);
  EXPECT_EQ(config.heads[1].take_mode, TakeMode::kJpeg);
  EXPECT_EQ(config.takes->quality, 80);
  expect_takes_refused(rig_with_takes("take_mode = \"mp4\"\n", kTakesFolder),
                       "allowed is one of driver, raw, jpeg, lossless");
  expect_takes_refused(rig_with_takes("", kTakesFolder + "mode = \"raw\"\nquality = 80\n"),
                       "takes has a quality, which is for mode = \"jpeg\"");
  expect_takes_refused("[rig]\nname = \"r\"\n[[heads]]\nname = \"a\"\nport = \"replay:a.png\"\ntake_mode = \"raw\"\n",
                       "heads[0].take_mode is for rigs that record");
}

}  // namespace
}  // namespace nodal::firmware
