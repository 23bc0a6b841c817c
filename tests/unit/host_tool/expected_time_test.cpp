// How long a computation is likely to take, in words.
#include "host_tool/commands/expected_time.h"

#include <gtest/gtest.h>

namespace nodal::host {
namespace {

TEST(ExpectedTime, OnlyWhatIsLongerThanTenSeconds_IsSaidInRoundNumbers) {
  EXPECT_EQ(expected_time({}, 2), "");
  EXPECT_EQ(expected_time({.blended_px = 4e6}, 1), "") << "8.8 s";
  EXPECT_EQ(expected_time({.blended_px = 5e6}, 1), "this takes about 20 s on this computer") << "11 s";
  EXPECT_EQ(expected_time({.placed = 40, .picture_px = 1e6}, 0), "this takes about 50 s on this computer")
      << "48 s on one core";
  EXPECT_EQ(expected_time({.placed = 50, .picture_px = 1e6}, 1), "this takes about a minute on this computer");
  EXPECT_EQ(expected_time({.blended_px = 80e6}, 2), "this takes about 2 minutes on this computer") << "114 s";
  EXPECT_EQ(expected_time({.picture_px = 1e6, .registered = 10}, 1), "this takes about 20 s on this computer")
      << "18 s";
}

TEST(ExpectedTime, PicturesLargerThanFeaturesNeed_TakeNoLonger) {
  EXPECT_EQ(expected_time({.placed = 60, .picture_px = 2e6}, 1), expected_time({.placed = 60, .picture_px = 9e6}, 1));
}

TEST(ExpectedTime, MoreCores_TakeLess) {
  const ExpectedWork work{.placed = 50, .picture_px = 1e6};
  EXPECT_EQ(expected_time(work, 4), "this takes about 30 s on this computer") << "60 s * (0.3 + 0.7 / 4)";
  EXPECT_EQ(expected_time(work, 1000), "this takes about 20 s on this computer");
}

}  // namespace
}  // namespace nodal::host
