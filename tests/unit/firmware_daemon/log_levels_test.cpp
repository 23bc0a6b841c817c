// Levels of the log by category.
#include <gtest/gtest.h>

#include "firmware/daemon/log.h"

namespace nodal::daemon {
namespace {

LogLevel level_of(const Result<LogLevels>& levels, LogCategory category) {
  return levels->of[static_cast<std::size_t>(category)];
}

TEST(LogLevelsOption, OneLevel_IsThatOfAllCategories) {
  const auto levels = LogLevels::parse("debug");
  ASSERT_TRUE(levels);
  for (const LogLevel each : levels->of) EXPECT_EQ(each, LogLevel::kDebug);
}

TEST(LogLevelsOption, LevelsOfCategories_AreTheirsAndTheOthersStay) {
  const auto levels = LogLevels::parse("warning,capture=debug,v4l2=trace");
  ASSERT_TRUE(levels) << levels.error().text();
  EXPECT_EQ(level_of(levels, LogCategory::kRig), LogLevel::kWarning);
  EXPECT_EQ(level_of(levels, LogCategory::kCapture), LogLevel::kDebug);
  EXPECT_EQ(level_of(levels, LogCategory::kV4l2), LogLevel::kTrace);
  EXPECT_EQ(level_of(levels, LogCategory::kGpio), LogLevel::kWarning);
}

TEST(LogLevelsOption, WhatThereIsNot_IsNamedWithWhatThereIs) {
  for (const auto& [text, wrong] :
       {std::pair{"loud", "level 'loud'"}, std::pair{"v4l=trace", "category 'v4l'"}, std::pair{"v4l2=", "level ''"},
        std::pair{"debug,", "level ''"}, std::pair{"", "level ''"}}) {
    const auto levels = LogLevels::parse(text);
    ASSERT_FALSE(levels) << text;
    EXPECT_EQ(levels.error().code, Errc::kBadValue);
    EXPECT_NE(levels.error().message.find(wrong), std::string::npos) << levels.error().message;
    EXPECT_NE(levels.error().message.find("there are "), std::string::npos) << levels.error().message;
  }
}

}  // namespace
}  // namespace nodal::daemon
