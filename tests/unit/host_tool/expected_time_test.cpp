// How long a computation is likely to take, in words.
#include "host_tool/commands/expected_time.h"

#include <gtest/gtest.h>

namespace nodal::host {
namespace {

TEST(ExpectedTime, OnlyWhatIsLongerThanTenSeconds_IsSaidInRoundNumbers) {
  EXPECT_EQ(expected_time({}, 2), "");
  EXPECT_EQ(expected_time({.blended_px = 4e6}, 1), "") << "8.8 s";
  EXPECT_EQ(expected_time({.blended_px = 5e6}, 1), "this takes about 20 s on this computer") << "11 s";
  EXPECT_EQ(expected_time({.calibrated = 8}, 0), "this takes about 50 s on this computer") << "48 s on one core";
  EXPECT_EQ(expected_time({.calibrated = 10}, 1), "this takes about a minute on this computer");
  EXPECT_EQ(expected_time({.calibrated = 25}, 2), "this takes about 2 minutes on this computer") << "105 s";
  EXPECT_EQ(expected_time({.registered = 10}, 1), "this takes about 20 s on this computer");
}

TEST(ExpectedTime, MoreCores_TakeLess) {
  EXPECT_EQ(expected_time({.calibrated = 10}, 4), "this takes about 40 s on this computer") << "60 s * (0.4 + 0.6 / 4)";
  EXPECT_EQ(expected_time({.calibrated = 10}, 1000), "this takes about 30 s on this computer");
}

}  // namespace
}  // namespace nodal::host
