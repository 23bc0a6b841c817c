#include "firmware/frame/statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "firmware/frame/snapshot.h"

namespace nodal::firmware {
namespace {

TEST(RecentTimes, OfOneToSixtyFour_TheMedianIsInTheMiddle) {
  RecentTimes times;
  EXPECT_EQ(times.median(), Duration());
  for (int i = 64; i >= 1; --i) times.add(Duration::milliseconds(i));
  EXPECT_EQ(times.median(), Duration::milliseconds(33));
  for (int i = 0; i < 64; ++i) times.add(Duration::milliseconds(7));
  EXPECT_EQ(times.median(), Duration::milliseconds(7)) << "old times are forgotten";
}

TEST(RecentRate, ThirtyASecond_IsThirtyAndForgetsWhatIsLongAgo) {
  RecentRate rate;
  EXPECT_EQ(rate.millihertz(), 0u);
  Instant now;
  std::uint64_t total = 0;
  for (int i = 0; i < 100; ++i) {
    rate.observe(total, now);
    now = now + Duration::milliseconds(100);
    total += 3;
  }
  EXPECT_EQ(rate.millihertz(), 30'000u);
  for (int i = 0; i < 100; ++i) {
    rate.observe(total, now);
    now = now + Duration::milliseconds(100);
  }
  EXPECT_EQ(rate.millihertz(), 0u);
}

TEST(RecentRate, OneInSeconds_IsExactFromTheSecondOn) {
  for (const int seconds : {1, 5, 1000}) {
    RecentRate rate;
    Instant now;
    for (int tenth = 0; tenth < 30 * 10 * seconds; ++tenth) {
      const int events = tenth / (10 * seconds);
      rate.observe(static_cast<std::uint64_t>(events), now);
      now = now + Duration::milliseconds(100);
      if (events >= 2) {
        ASSERT_EQ(rate.millihertz(), 1000u / static_cast<unsigned>(seconds)) << tenth << " tenths";
      }
    }
  }
}

TEST(RecentRate, NoMoreComesForMoreThanTwiceItsInterval_FallsAsTimePasses) {
  RecentRate rate;
  Instant now;
  for (int half = 0; half <= 9; ++half) {
    rate.observe(std::min<std::uint64_t>(half / 2, 2), now + Duration::milliseconds(500) * half);
    if (half < 4 || half > 8) continue;
    EXPECT_EQ(rate.millihertz(), 1000u) << half << " half seconds";
  }
  EXPECT_EQ(rate.millihertz(), 2u * 1'000'000 / 4500) << "two in 4.5 s";
}

TEST(MilliHertz, OfNtsc_Is29970) { EXPECT_EQ(millihertz(FrameRate{30000, 1001}), 29'970u); }

TEST(Snapshot, ReadBeforeAnything_IsADefault) {
  Snapshot<std::string> snapshot;
  EXPECT_EQ(snapshot.read(), "");
}

TEST(Snapshot, ReadAgain_IsTheNewestOnly) {
  Snapshot<std::string> snapshot;
  snapshot.publish("one");
  snapshot.publish("two");
  EXPECT_EQ(snapshot.read(), "two");
  EXPECT_EQ(snapshot.read(), "two");
  snapshot.publish("three");
  EXPECT_EQ(snapshot.read(), "three");
}

TEST(Snapshot, WrittenWhileItIsRead_IsNeverHalfOneAndHalfAnother) {
  struct Big {
    std::vector<std::uint64_t> values = std::vector<std::uint64_t>(64, 0);
  };
  Snapshot<Big> snapshot;
  constexpr std::uint64_t kTimes = 20'000;
  std::thread writer([&] {
    Big big;
    for (std::uint64_t n = 1; n <= kTimes; ++n) {
      big.values.assign(64, n);
      snapshot.publish(big);
    }
  });
  std::uint64_t last = 0;
  while (last < kTimes) {
    const Big& big = snapshot.read();
    for (const std::uint64_t value : big.values) ASSERT_EQ(value, big.values.front());
    ASSERT_GE(big.values.front(), last);
    last = big.values.front();
  }
  writer.join();
}

}  // namespace
}  // namespace nodal::firmware
