// The tests that every ClockPort must pass.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <ostream>
#include <thread>
#include <vector>

#include "hal/clock.h"
#include "hal/linux/clock.h"
#include "hal/sim/clock.h"

namespace nodal::hal {

namespace {

struct ClockKind {
  std::string name;
  bool real;
  std::function<std::unique_ptr<ClockPort>()> make;
  friend std::ostream& operator<<(std::ostream& out, const ClockKind& kind) { return out << kind.name; }
};

class ClockConformance : public testing::TestWithParam<ClockKind> {
 protected:
  std::unique_ptr<ClockPort> clock_ = GetParam().make();
};

TEST_P(ClockConformance, AskedManyTimes_NeverGoesBackwards) {
  Instant last = clock_->now();
  for (int i = 0; i < 10'000; ++i) {
    const Instant now = clock_->now();
    ASSERT_GE(now, last);
    last = now;
  }
}

TEST_P(ClockConformance, AskedFromManyThreads_NoneSeesItGoBackwards) {
  std::atomic<std::int64_t> newest{clock_->now().ns()};
  std::atomic<int> backwards{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 5'000; ++i) {
        const std::int64_t before = newest.load();
        const std::int64_t now = clock_->now().ns();
        if (now < before) ++backwards;
        std::int64_t seen = newest.load();
        while (seen < now && !newest.compare_exchange_weak(seen, now)) {}
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(backwards, 0);
}

// The kernel's value of the same clock, read in another way.
TEST_P(ClockConformance, RealTime_IsTheKernelsMonotonicClock) {
  if (!GetParam().real) GTEST_SKIP() << "virtual time";
  const auto steady = [] { return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1); };
  const std::int64_t before = steady();
  const std::int64_t now = clock_->now().ns();
  const std::int64_t after = steady();
  EXPECT_GE(now, before);
  EXPECT_LE(now, after);
}

TEST_P(ClockConformance, VirtualTime_StandsStillUntilAdvanced) {
  if (GetParam().real) GTEST_SKIP() << "real time";
  auto& clock = dynamic_cast<sim::SimClock&>(*clock_);
  const Instant start = clock.now();
  EXPECT_EQ(clock.now(), start);
  clock.advance(Duration::milliseconds(7));
  EXPECT_EQ(clock.now() - start, Duration::milliseconds(7));
  clock.advance_to(start + Duration::seconds(86'400));
  EXPECT_EQ(clock.now() - start, Duration::seconds(86'400));
}

INSTANTIATE_TEST_SUITE_P(
    All, ClockConformance,
    testing::Values(ClockKind{"Linux", true, [] { return std::make_unique<linux_os::LinuxClock>(); }},
                    ClockKind{"SimReal", true,
                              [] { return std::make_unique<sim::SimClock>(sim::SimClock::Kind::kReal); }},
                    ClockKind{"SimVirtual", false, [] { return std::make_unique<sim::SimClock>(); }}),
    [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
