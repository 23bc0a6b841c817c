// The log's sentences: none can forge a line, none can flood a disk, and dropped sentences are counted.
#include "firmware/operate/news.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

namespace nodal::firmware {
namespace {

constexpr Instant kStart;

Instant after(std::int64_t seconds) { return kStart + Duration::seconds(seconds); }

/// The sum of the numbers at the start of the summaries of dropped sentences.
std::uint64_t left_out(const std::vector<std::string>& sentences) {
  std::uint64_t sum = 0;
  for (const std::string& sentence : sentences) {
    if (sentence.find(" left out in the last ") != std::string::npos)
      sum += std::strtoull(sentence.c_str(), nullptr, 10);
  }
  return sum;
}

TEST(News, TextWithControlsAndBidirectionalOverrides_IsOneHarmlessLine) {
  News news(kStart);
  news.say(NewsKind::kRig, "a\nnodald: forged\x1B[2J\xE2\x80\xAE");
  EXPECT_EQ(news.take(), std::vector<std::string>{"a?nodald: forged?[2J?"});
}

TEST(News, ALongSentence_IsCutOff) {
  News news(kStart);
  news.say(NewsKind::kRig, std::string(100'000, 'x'));
  EXPECT_EQ(news.take().front().size(), News::kLongestSentence);
}

TEST(News, AFloodOfOneKind_IsCutToBurstAndRateAndTheRestIsCounted) {
  News news(kStart);
  constexpr std::int64_t kSeconds = 60;
  constexpr std::uint64_t kEachSecond = 15'000;
  std::vector<std::string> all;
  for (std::int64_t second = 0; second < kSeconds; ++second) {
    news.step(after(second));
    for (std::uint64_t i = 0; i < kEachSecond; ++i) news.say(NewsKind::kHosts, "flood");
    const std::vector<std::string> some = news.take();
    all.insert(all.end(), some.begin(), some.end());
  }
  news.step(after(kSeconds + 10));
  const std::vector<std::string> rest = news.take();
  all.insert(all.end(), rest.begin(), rest.end());
  const auto said = static_cast<std::uint64_t>(std::count(all.begin(), all.end(), "flood"));
  constexpr std::int64_t kFlood = 5 + News::kLineBytes;  // bytes of log
  constexpr std::int64_t kAllowed = (8 << 10) + 59 * 160;
  EXPECT_LE(static_cast<std::int64_t>(said) * kFlood, kAllowed + kFlood);
  EXPECT_GE(static_cast<std::int64_t>(said) * kFlood, kAllowed - kFlood);
  EXPECT_EQ(said + left_out(all), kSeconds * kEachSecond) << "every sentence is said or counted";
  EXPECT_LE(all.size(), said + kSeconds / 10 + 1) << "summaries are rate-limited, too";
}

TEST(News, AFloodOfOneKind_HidesNoOtherKind) {
  News news(kStart);
  for (int i = 0; i < 1000; ++i) news.say(NewsKind::kHosts, "flood");
  news.say(NewsKind::kChanges, "a change");
  const std::vector<std::string> all = news.take();
  EXPECT_EQ(all.back(), "a change");
}

TEST(News, AfterAFlood_TheAllowanceReturns) {
  News news(kStart);
  for (int i = 0; i < 1000; ++i) news.say(NewsKind::kRig, "flood");
  news.take();
  news.step(after(2));
  for (int i = 0; i < 100; ++i) news.say(NewsKind::kRig, std::string(100, 'x'));
  EXPECT_EQ(news.take().size(), 2U) << "320 bytes, less what the flood's last exceeded; the last of these exceeds them";
  news.step(after(1'000'000'000));
  for (int i = 0; i < 1000; ++i) news.say(NewsKind::kRig, std::string(100, 'x'));
  EXPECT_EQ(news.take().size(), 1 + 8192U / 140 + 1) << "a long silence gives no more than a burst, and a count";
}

}  // namespace
}  // namespace nodal::firmware
