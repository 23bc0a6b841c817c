// Arithmetic of units, with values that the compiler does not know.
#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/stops.h"
#include "protocol/base/units.h"

namespace nodal {
namespace {

std::int64_t given(std::int64_t value) {
  volatile std::int64_t hidden = value;
  return hidden;
}
Duration ns(std::int64_t value) { return Duration::nanoseconds(given(value)); }
Instant at(std::int64_t value) { return Instant::from_ns(given(value)); }

TEST(Durations, UnitsOfASecond_AreItsPowersOfAThousand) {
  EXPECT_EQ(Duration::seconds(given(2)).ns(), 2'000'000'000);
  EXPECT_EQ(Duration::milliseconds(given(2)).ns(), 2'000'000);
  EXPECT_EQ(Duration::microseconds(given(2)).ns(), 2'000);
  EXPECT_EQ(ns(3'999'999'999).ms(), 3'999);
  EXPECT_EQ(ns(3'999'999).us(), 3'999);
  EXPECT_EQ(Exposure::of(ns(8'000'999)).us(), 8'000);
}

TEST(Durations, SumsAndMultiples_AreThoseOfTheirNanoseconds) {
  EXPECT_EQ((ns(7) + ns(3)).ns(), 10);
  EXPECT_EQ((ns(7) - ns(10)).ns(), -3);
  EXPECT_EQ((-ns(7)).ns(), -7);
  EXPECT_EQ(abs(ns(-7)).ns(), 7);
  EXPECT_EQ(abs(ns(7)).ns(), 7);
  EXPECT_EQ((ns(7) * given(3)).ns(), 21);
  EXPECT_EQ((ns(7) / given(2)).ns(), 3);
}

TEST(Instants, DifferencesAndShifts_AreThoseOfTheirNanoseconds) {
  EXPECT_EQ((at(10) - at(3)).ns(), 7);
  EXPECT_EQ((at(10) + ns(3)).ns(), 13);
  EXPECT_EQ((at(10) - ns(3)).ns(), 7);
}

TEST(FrameRate, TermsAtTheirLimits_AreAcceptedAndOneMoreIsNot) {
  const auto made = [](std::int64_t n, std::int64_t d) {
    return FrameRate::make(static_cast<std::uint64_t>(given(n)), static_cast<std::uint64_t>(given(d)));
  };
  EXPECT_EQ(made(1'000'000, 999'999), (FrameRate{1'000'000, 999'999}));
  EXPECT_EQ(made(999'999, 1'000'000), (FrameRate{999'999, 1'000'000}));
  EXPECT_EQ(made(1'000'001, 1'000'000), std::nullopt);
  EXPECT_EQ(made(1'000'000, 1'000'001), std::nullopt);
  EXPECT_EQ(made(60'000, 2'002), (FrameRate{30'000, 1'001}));
  EXPECT_EQ(made(1'000, 1), (FrameRate{1'000, 1}));
  EXPECT_EQ(made(999'999, 999), std::nullopt) << "1001 frames a second";
  EXPECT_EQ(made(999, 999'999), std::nullopt) << "a frame in 1001 seconds";
  EXPECT_FALSE((FrameRate{static_cast<std::uint32_t>(given(0)), 1}.valid()));
  EXPECT_TRUE((FrameRate{static_cast<std::uint32_t>(given(25)), 1}.valid()));
}

TEST(FrameRate, PeriodAndNextFrame_AreThoseOfTheFraction) {
  const FrameRate ntsc{static_cast<std::uint32_t>(given(30'000)), 1'001};
  EXPECT_EQ(ntsc.period().ns(), 33'366'666);
  EXPECT_EQ(ntsc.start_of(3).ns(), 100'100'000);
  EXPECT_EQ(ntsc.first_after(ns(0)), 1u) << "frame 0 starts at 0, not after it";
  EXPECT_EQ(ntsc.first_after(ns(-1)), 0u);
  EXPECT_EQ(ntsc.first_after(ns(100'099'999)), 3u);
  EXPECT_EQ(ntsc.first_after(ns(100'100'000)), 4u);
}

// 20 log10(2) dB are a factor of two in light; rounded to the nearest on both sides of zero.
TEST(Stops, GainsOfAllStops_AreTheNearestMillidecibelsAndBack) {
  for (Stops stops = -8 * kStop; stops <= 8 * kStop; stops += 37) {
    const double exact = stops * 6020.6 / 1024;
    EXPECT_LE(std::abs(gain_of(static_cast<Stops>(given(stops))).mdb() - exact), 0.5 + 1e-9) << stops;
  }
  for (std::int32_t mdb = -48'000; mdb <= 48'000; mdb += 113) {
    const double exact = mdb * 1024 / 6020.6;
    EXPECT_LE(std::abs(stops_of(Gain::millidecibels(static_cast<std::int32_t>(given(mdb)))) - exact), 0.5 + 1e-9)
        << mdb;
  }
}

TEST(Stops, ExposureOfNothing_HasNone) {
  EXPECT_EQ(stops_of(Exposure::microseconds(given(0))), 0);
  EXPECT_EQ(stops_of(Exposure::microseconds(given(1024))), 10 * kStop);
}

}  // namespace
}  // namespace nodal
