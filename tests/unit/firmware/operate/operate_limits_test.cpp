// What commands allow about takes, what the audit log says of each command, and what the log sums up.
#include <gtest/gtest.h>

#include "firmware/operate/audit.h"
#include "firmware/operate/commands.h"
#include "firmware/operate/news.h"
#include "firmware/record/disk_test.h"

namespace nodal::firmware {
namespace {

RigConfig rig_with_takes() {
  RigConfig config;
  config.heads.resize(2);
  config.takes.emplace();
  return config;
}

TEST(TakeCommands, MarksAndTestsOfTheDisk_AreAllowedToTheirLimits) {
  const RigConfig config = rig_with_takes();
  const auto mark = [&](const std::string& text) {
    return check(TakeCommand(TakeRequest::Mark{text}), config).has_value();
  };
  const auto test = [&](Duration length) {
    return check(TakeCommand(TakeRequest::TestDisk{length, {}}), config).has_value();
  };
  EXPECT_TRUE(mark(std::string(TakeRequest::Mark::kMaxBytes, 'x')));
  EXPECT_FALSE(mark(std::string(TakeRequest::Mark::kMaxBytes + 1, 'x')));
  EXPECT_FALSE(mark("a line\nand another"));
  EXPECT_TRUE(test(Duration::seconds(1)));
  EXPECT_FALSE(test(Duration::seconds(1) - Duration::nanoseconds(1)));
  EXPECT_TRUE(test(Duration::seconds(60)));
  EXPECT_FALSE(test(Duration::seconds(60) + Duration::nanoseconds(1)));
}

TEST(TakeCommands, WithoutASectionTakes_NoneIsAllowed) {
  RigConfig config = rig_with_takes();
  config.takes.reset();
  for (const TakeCommand& command : {TakeCommand(TakeRequest::Start{}), TakeCommand(TakeRequest::Mark{"here"})}) {
    EXPECT_FALSE(check(command, config));
    EXPECT_TRUE(check(command, rig_with_takes()));
  }
}

TEST(Audit, OfEachCommandAboutTakes_SaysWhatIsSoAfterIt) {
  const RigConfig config = rig_with_takes();
  const std::vector<std::pair<Command, std::string>> all{
      {TakeCommand(TakeRequest::Start{}), "a take is recorded"},
      {TakeCommand(TakeRequest::Stop{}), "no take is recorded"},
      {TakeCommand(TakeRequest::Mark{"here"}), "mark 'here'"},
      {TakeCommand(TakeRequest::Delete{7, {}}), "take 7 deleted"},
      {TakeCommand(TakeRequest::Protect{7, true}), "take 7 protected"},
      {TakeCommand(TakeRequest::Protect{7, false}), "take 7 not protected"},
      {TakeCommand(TakeRequest::TestDisk{}), "the disk is tested"}};
  for (const auto& [command, text] : all) EXPECT_EQ(values_after(command, config, {}), text);
}

TEST(Audit, OfAChangeOfHeads_NamesThoseItIsFor) {
  const RigConfig config = rig_with_takes();
  HeadChange set;
  set.change.exposure = Exposure::microseconds(4000);
  set.heads = 3;
  EXPECT_EQ(values_after(CaptureCommand(set), config, {}).find("all heads: "), 0u);
  set.heads = 2;
  EXPECT_EQ(values_after(CaptureCommand(set), config, {}).find("heads 1: "), 0u);
}

TEST(News, TheSummary_SaysHowManyOfWhatInHowManySeconds) {
  News news{Instant()};
  const std::string longest(News::kLongestSentence, 'x');
  int said = 0, left_out = 0;
  for (int i = 0; i < 200; ++i) {
    news.say(NewsKind::kRig, longest);
    if (news.take().empty()) ++left_out;
    else ++said;
  }
  ASSERT_GT(said, 0);
  ASSERT_GT(left_out, 0);
  for (int second = 1; second <= 10; ++second) news.step(Instant() + Duration::seconds(second));
  EXPECT_EQ(news.take(),
            std::vector<std::string>{std::to_string(left_out) + " messages about the rig left out in the last 10 s"});
}

}  // namespace
}  // namespace nodal::firmware
