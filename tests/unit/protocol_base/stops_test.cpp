#include "protocol/base/stops.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nodal {
namespace {

TEST(Stops, Logarithms_AreTheTrueOnesCutToA1024th) {
  for (std::uint64_t value = 1; value < 1'000'000'000'000; value = value * 9 / 8 + 1) {
    const double exact = 1024 * std::log2(static_cast<double>(value));
    EXPECT_LE(log2_stops(value), exact + 1e-6) << value;
    EXPECT_GT(log2_stops(value), exact - 1.001) << value;
  }
}

TEST(Stops, Powers_AreTheTrueOnesRounded) {
  for (Stops stops = -3000; stops < 20'000; stops += 7) {
    const double exact = 1000 * std::exp2(stops / 1024.0);
    EXPECT_NEAR(static_cast<double>(exp2_stops(stops, 1000)), exact, 0.51 + exact * 1e-7) << stops;
  }
}

TEST(Stops, ExposuresAndGains_AStopIsTwiceTheLight) {
  EXPECT_EQ(stops_of(Exposure::microseconds(1)), 0);
  EXPECT_NEAR(stops_of(Exposure::microseconds(8000)) - stops_of(Exposure::microseconds(1000)), 3 * kStop, 1);
  EXPECT_EQ(stops_of(Gain::millidecibels(6021)), kStop);
  EXPECT_EQ(stops_of(Gain::millidecibels(-6021)), -kStop);
  EXPECT_NEAR(gain_of(2 * kStop).mdb(), 12'041, 1);
}

}  // namespace
}  // namespace nodal
