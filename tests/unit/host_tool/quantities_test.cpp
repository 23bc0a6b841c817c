#include "host_tool/console/quantities.h"

#include <gtest/gtest.h>

#include <rapidcheck.h>

#include <limits>
#include <string>

namespace nodal::host {
namespace {

TEST(Counted, OneAndOthers_HaveTheirForms) {
  EXPECT_EQ(counted(0, "pulse"), "0 pulses");
  EXPECT_EQ(counted(1, "pulse"), "1 pulse");
  EXPECT_EQ(counted(2, "pulse"), "2 pulses");
}

TEST(ParseExposure, WaysPeopleWriteIt_GiveTheSameTime) {
  EXPECT_EQ(parse_exposure("8ms")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("8 ms")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("8000us")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("8000µs")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("1/125")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("1/125s")->duration().ns(), 8'000'000);
  EXPECT_EQ(parse_exposure("0.008s")->duration().ns(), 8'000'000);
}

TEST(ParseExposure, ThirdOfASecond_IsRoundedToTheNearestNanosecond) {
  EXPECT_EQ(parse_exposure("1/3")->duration().ns(), 333'333'333);
  EXPECT_EQ(parse_exposure("2/3")->duration().ns(), 666'666'667);
}

TEST(ParseExposure, WhatIsNoExposure_IsRefusedWithTheTextAndWhatWouldDo) {
  for (const char* text : {"",       "8",        "ms",      "8m",           "-8ms",        "0ms",   "0/125",
                           "1/0",    "1/",       "/125",    "1/125ms",      "nan",         "inf",   "8ms ",
                           "1e999s", "8 parsec", "1/125/2", "1/4294967295", "1/100000000", "999ns", "4294967295/1"}) {
    const auto exposure = parse_exposure(text);
    ASSERT_FALSE(exposure) << text;
    EXPECT_EQ(exposure.error().code, Errc::kBadValue);
    EXPECT_NE(exposure.error().message.find("'" + std::string(text) + "'"), std::string::npos);
    EXPECT_NE(exposure.error().message.find("1/125"), std::string::npos);
  }
}

TEST(ParseGain, Decibels_AreKeptToTheThousandth) {
  EXPECT_EQ(parse_gain("6dB")->mdb(), 6000);
  EXPECT_EQ(parse_gain("6.02 dB")->mdb(), 6020);
  EXPECT_EQ(parse_gain("-3.5dB")->mdb(), -3500);
  EXPECT_EQ(parse_gain("+1db")->mdb(), 1000);
  EXPECT_EQ(parse_gain("0dB")->mdb(), 0);
}

TEST(ParseGain, BareNumbersAndOtherUnits_AreRefused) {
  for (const char* text : {"6", "6x", "dB", "", "6 dBm", "nandB", "101dB", "--3dB"}) {
    EXPECT_FALSE(parse_gain(text)) << text;
  }
}

TEST(ParseWhiteBalance, FactorsAgainstGreen_BecomeQ12) {
  const auto balance = parse_white_balance("1.5,1.25");
  ASSERT_TRUE(balance);
  EXPECT_EQ(balance->red_q12, 6144);
  EXPECT_EQ(balance->blue_q12, 5120);
  EXPECT_EQ(parse_white_balance("1,1"), WhiteBalance{});
}

TEST(ParseWhiteBalance, OutsideTheSixteenBits_IsRefused) {
  for (const char* text : {"1", "1,", ",1", "1,1,1", "0,1", "16,1", "1,-1", "1,nan", "1x,1"}) {
    EXPECT_FALSE(parse_white_balance(text)) << text;
  }
}

TEST(ParseRate, NtscNames_StandForTheirFractions) {
  EXPECT_EQ(*parse_rate("29.97"), (FrameRate{30000, 1001}));
  EXPECT_EQ(*parse_rate("30000/1001"), (FrameRate{30000, 1001}));
  EXPECT_EQ(*parse_rate("59.94"), (FrameRate{60000, 1001}));
  EXPECT_EQ(*parse_rate("23.976"), (FrameRate{24000, 1001}));
  EXPECT_EQ(*parse_rate("25"), (FrameRate{25, 1}));
  EXPECT_EQ(*parse_rate("12.5"), (FrameRate{25, 2}));
}

TEST(ParseRate, ZeroAndWhatNoRigCanDo_IsRefused) {
  for (const char* text : {"0", "0/1", "1/0", "-25", "1001", "2000/1", "1/1001", "fast", "", "25fps", "25/", "1e300",
                           "299700300/10000000", "2997003/100000"}) {
    const auto rate = parse_rate(text);
    ASSERT_FALSE(rate) << text;
    EXPECT_NE(rate.error().message.find("1/1000 to 1000"), std::string::npos) << rate.error().message;
  }
  EXPECT_EQ(*parse_rate("4294967295/4294967295"), (FrameRate{1, 1}));
}

TEST(ParseDuration, EveryUnit_IsTaken) {
  using Case = std::pair<const char*, std::int64_t>;
  for (const auto& [text, ns] : {Case{"7ns", 7}, Case{"250us", 250'000}, Case{"250µs", 250'000}, Case{"8ms", 8'000'000},
                                 Case{"0.5s", 500'000'000}, Case{"1m", 60'000'000'000}, Case{"2min", 120'000'000'000},
                                 Case{"1.5h", 5'400'000'000'000}, Case{"1d", 86'400'000'000'000}}) {
    const auto duration = parse_duration(text);
    ASSERT_TRUE(duration) << text;
    EXPECT_EQ(duration->ns(), ns) << text;
  }
  const auto refused = parse_duration("1y");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("ns, us, ms, s, m or min (minutes), h (hours) and d (days)"),
            std::string::npos);
}

TEST(ParseExposure, MinutesByOneLetter_AreRefusedAsASlipForMilliseconds) {
  EXPECT_FALSE(parse_exposure("8m"));
  EXPECT_EQ(parse_exposure("8ms")->duration().ns(), 8'000'000);
}

TEST(ParseDuration, MoreThanADay_IsRefused) {
  EXPECT_EQ(parse_duration("1440min")->ns(), 86'400'000'000'000);
  EXPECT_FALSE(parse_duration("1441min"));
  EXPECT_FALSE(parse_duration("5"));
}

TEST(ShowDuration, EveryMagnitude_ReadsNaturally) {
  EXPECT_EQ(show_duration(0), "0 ns");
  EXPECT_EQ(show_duration(999), "999 ns");
  EXPECT_EQ(show_duration(12'340), "12.34 µs");
  EXPECT_EQ(show_duration(999'999), "1 ms");
  EXPECT_EQ(show_duration(8'000'000), "8 ms");
  EXPECT_EQ(show_duration(33'366'666), "33.37 ms");
  EXPECT_EQ(show_duration(1'500'000'000), "1.5 s");
  EXPECT_EQ(show_duration(61'000'000'000), "1 min 01 s");
  EXPECT_EQ(show_duration(7'380'000'000'000), "2 h 03 min");
}

TEST(ShowDuration, WhatItShowsBelowAMinute_ReadsBackWithinItsFourDigits) {
  rc::check([] {
    const auto ns = *rc::gen::inRange<std::int64_t>(1, 59'000'000'000);
    const auto back = parse_duration(show_duration(static_cast<std::uint64_t>(ns)));
    RC_ASSERT(back.has_value());
    RC_ASSERT(std::abs(static_cast<double>(back->ns() - ns)) <= 0.0006 * static_cast<double>(ns));
  });
}

TEST(ShowBytes, EveryMagnitude_ReadsNaturally) {
  EXPECT_EQ(show_bytes(512), "512 B");
  EXPECT_EQ(show_bytes(1'500'000), "1.5 MB");
  EXPECT_EQ(show_bytes(2'000'000'000), "2.00 GB");
}

TEST(ShowId, ThirtyTwoBytes_ShowAsTheirFirstTwelveDigits) {
  EXPECT_EQ(show_id(std::string("\x3f\xa2\x00\x01\xff\x10", 6) + std::string(26, 'x')), "3fa20001ff10");
  EXPECT_EQ(show_id(""), "none");
}

TEST(Quantities, Deviations_HeldOrUnknownOnesAreSaidInWords) {
  EXPECT_EQ(show_deviation(0.00432, "°"), "0.0043°");
  EXPECT_EQ(show_deviation(0, "°"), "fixed");
  EXPECT_EQ(show_deviation(std::numeric_limits<double>::infinity(), " %"), "?");
}

}  // namespace
}  // namespace nodal::host
