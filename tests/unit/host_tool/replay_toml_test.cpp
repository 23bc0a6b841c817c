// A rig.toml that a command writes is one that nodald reads.
#include "host_tool/commands/replay_toml.h"

#include <gtest/gtest.h>

#include "tests/support/rigs.h"

namespace nodal::host {
namespace {

TEST(ReplayToml, NamesOfPicturesWithQuotesAndControlCharacters_AreReadBackAsTheyAre) {
  const Calibration rig = test::ring(2, 640, 480);
  const auto text =
      replay_rig_toml(rig, {"/a/\"quoted\" \\ name.png", "/a/line\nbreak\x01.png"}, "p.pto", "/b/rig.toml");
  ASSERT_TRUE(text) << text.error().text();
  EXPECT_NE(text->find("line\\u000Abreak\\u0001.png"), std::string::npos) << *text;
}

TEST(ReplayToml, ASourceWithALineBreak_ForgesNoKey) {
  const Calibration rig = test::ring(2, 640, 480);
  const auto text = replay_rig_toml(rig, {"/a/0.png", "/a/1.png"}, "p\nname = \"forged\"\n.pto", "/b/rig.toml");
  ASSERT_TRUE(text) << text.error().text();
  EXPECT_EQ(text->find("\nname = \"forged\""), std::string::npos) << *text;
}

TEST(ReplayToml, AHeadWhoseNameNodaldRefuses_IsAnErrorThatNamesTheFile) {
  Calibration rig = test::ring(2, 640, 480);
  rig.heads[1].name = "left eye";
  const auto text = replay_rig_toml(rig, {"/a/0.png", "/a/1.png"}, "p.pto", "/b/rig.toml");
  ASSERT_FALSE(text);
  EXPECT_NE(text.error().message.find("/b/rig.toml"), std::string::npos) << text.error().text();
  EXPECT_NE(text.error().message.find("left eye"), std::string::npos) << text.error().text();
}

TEST(ReplayToml, APictureWhoseNameIsNoUtf8_IsAnError) {
  const Calibration rig = test::ring(2, 640, 480);
  EXPECT_FALSE(replay_rig_toml(rig, {"/a/0.png", "/a/\xff.png"}, "p.pto", "/b/rig.toml"));
}

}  // namespace
}  // namespace nodal::host
