// Points in time, against numbers of `date -u +%s`.
#include "host_tool/console/points_in_time.h"

#include <gtest/gtest.h>

namespace nodal::host {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kNow = 1'795'000'000 * kSecond;

TEST(PointInTime, DatesWithAndWithoutATime_AreUtc) {
  EXPECT_EQ(parse_point_in_time("1970-01-01", kNow), 0);
  EXPECT_EQ(parse_point_in_time("2000-02-29", kNow), 951'782'400 * kSecond);
  EXPECT_EQ(parse_point_in_time("2026-11-26", kNow), 1'795'651'200 * kSecond);
  for (const char* text : {"2026-11-26 12:30", "2026-11-26T12:30", "2026-11-26T12:30:00Z", "2026-11-26 12:30:00"}) {
    EXPECT_EQ(parse_point_in_time(text, kNow), 1'795'696'200 * kSecond) << text;
  }
}

TEST(PointInTime, TimesAgo_AreCountedBackFromTheRigsClock) {
  EXPECT_EQ(parse_point_in_time("90min", kNow), kNow - 5400 * kSecond);
  EXPECT_EQ(parse_point_in_time("1m", kNow), kNow - 60 * kSecond);
  EXPECT_EQ(parse_point_in_time("500ms", kNow), kNow - kSecond / 2);
  EXPECT_EQ(parse_point_in_time("36600d", kNow), kNow - 36'600LL * 86'400 * kSecond);
  EXPECT_EQ(parse_point_in_time("2h", kNow), kNow - 7200 * kSecond);
  EXPECT_EQ(parse_point_in_time("3d", kNow), kNow - 259'200 * kSecond);
  const auto unknown = parse_point_in_time("2h", 0);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, Errc::kNotReady);
}

TEST(PointInTime, AnythingElse_IsRefusedWithExamples) {
  for (const char* text : {"", "h", "2", "2M", "2months", "-2h", "36601d", "99999999999d", "1e300d", "yesterday",
                           "2026-11", "2026-13-01", "2026-02-29", "26-11-26", "2026-11-26 24:00", "2026-11-26 12:60",
                           "2026-11-26 12", "2026-11-26T12:30:00+01:00", "2026-11-26x"}) {
    const auto refused = parse_point_in_time(text, kNow);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().code, Errc::kBadValue);
    EXPECT_NE(refused.error().message.find("2026-11-26"), std::string::npos);
    EXPECT_NE(refused.error().message.find("m or min (minutes), h (hours) and d (days)"), std::string::npos);
  }
}

TEST(PointInTime, IsShownInUtc) {
  EXPECT_EQ(show_utc(1'795'696'215 * kSecond + 999'999'999), "2026-11-26 12:30:15");
  EXPECT_EQ(show_utc(0), "unknown");
  EXPECT_EQ(show_utc(-5), "unknown");
}

}  // namespace
}  // namespace nodal::host
