#include "stitch/parallel/workers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <thread>
#include <vector>

#include "stitch/parallel/part_of.h"

namespace nodal::parallel {
namespace {

TEST(Workers, EveryChunk_IsDoneOnce) {
  for (const int threads : {1, 2, 5}) {
    std::vector<std::atomic<int>> done(100);
    Workers(threads).run(100, [&](int i) { ++done[static_cast<std::size_t>(i)]; });
    for (const auto& one : done) EXPECT_EQ(one, 1);
  }
}

TEST(Workers, Progress_RisesOnTheCallersThread) {
  const std::thread::id caller = std::this_thread::get_id();
  std::vector<double> shares;
  std::atomic<int> done{0};
  Workers(3).run(
      50, [&](int) { ++done; },
      [&](double share) {
        EXPECT_EQ(std::this_thread::get_id(), caller);
        EXPECT_LE(share, done / 50.0 + 1e-9) << "no more than is done";
        shares.push_back(share);
      });
  EXPECT_EQ(done, 50);
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  std::vector<double> alone;
  Workers(1).run(
      4, [](int) {}, [&](double share) { alone.push_back(share); });
  EXPECT_EQ(alone, (std::vector<double>{0.25, 0.5, 0.75, 1}));
  Workers(2).run(
      4, [](int) {}, std::function<void(double)>());
}

TEST(PartOf, AShareOfAJob_IsToldAsProgressOfTheWhole) {
  std::vector<double> shares;
  const auto part = part_of([&](double done) { shares.push_back(done); }, 0.5, 0.25);
  part(0);
  part(1);
  EXPECT_EQ(shares, (std::vector<double>{0.5, 0.75}));
  EXPECT_FALSE(part_of({}, 0, 1));
}

}  // namespace
}  // namespace nodal::parallel
