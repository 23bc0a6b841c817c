#include "protocol/base/units.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <type_traits>

namespace nodal {
namespace {

// A year of NTSC: the start of frame n is exact to the nanosecond; summing periods would accumulate errors.
TEST(FrameRate, AYearOfNtsc_StartOfFrameDoesNotDrift) {
  const FrameRate ntsc{30000, 1001};
  const std::uint64_t n = 30000ULL * 31557;  // 31557 * 1001 s, about a year
  EXPECT_EQ(ntsc.start_of(n), Duration::seconds(31557LL * 1001));
  EXPECT_EQ(ntsc.start_of(1).ns(), 33'366'666);
}

// Rates from hosts that made 64 bits overflow after milliseconds, a minute and two hours.
TEST(FrameRate, TermsThatOverflowed_AreReducedOrRefused) {
  EXPECT_EQ(FrameRate::make(4294967295, 4294967295), (FrameRate{1, 1}));
  EXPECT_EQ(FrameRate::make(299700300, 10000000), std::nullopt);
  EXPECT_EQ(FrameRate::make(2997003, 100000), std::nullopt);
  EXPECT_EQ(FrameRate::make(0, 1), std::nullopt);
  EXPECT_EQ(FrameRate::make(1, 0), std::nullopt);
  EXPECT_EQ(FrameRate::make(1001, 1), std::nullopt);
  EXPECT_EQ(FrameRate::make(1, 1001), std::nullopt);
  EXPECT_TRUE(FrameRate::make(1000, 1) && FrameRate::make(1, 1000));
  EXPECT_EQ(FrameRate::make(UINT64_MAX, UINT64_MAX), (FrameRate{1, 1}));
}

// A hundred years at any accepted rate: successive starts differ by a period or one nanosecond more, and first_after()
// is the inverse of start_of().
RC_GTEST_PROP(FrameRate, AnyAcceptedRate_AHundredYearsOfFramesRiseByOnePeriodEach, ()) {
  const auto n = *rc::gen::inRange<std::uint64_t>(1, FrameRate::kMaxTerm + 1);
  const auto d = *rc::gen::inRange<std::uint64_t>(1, FrameRate::kMaxTerm + 1);
  const auto rate = FrameRate::make(n, d);
  RC_PRE(rate.has_value());
  const std::int64_t century = 100LL * 366 * 86'400 * 1'000'000'000;
  const std::uint64_t last = rate->first_after(Duration::nanoseconds(century));
  const auto frame = *rc::gen::inRange<std::uint64_t>(0, last + 1);
  const Duration start = rate->start_of(frame);
  const std::int64_t step = (rate->start_of(frame + 1) - start).ns();
  RC_ASSERT(start >= Duration() && start.ns() <= century + 1'000'000'000'000);
  RC_ASSERT(step == rate->period().ns() || step == rate->period().ns() + 1);
  RC_ASSERT(rate->first_after(start) == frame + 1);
  RC_ASSERT(rate->first_after(start - Duration::nanoseconds(1)) == frame);
}

TEST(FrameRate, LargestFrameNumber_StopsAtTheFarthestInstant) {
  EXPECT_EQ((FrameRate{1, 1000}.start_of(UINT64_MAX)).ns(), FrameRate::kFarthestNs);
  EXPECT_EQ((FrameRate{UINT32_MAX, UINT32_MAX}.start_of(UINT64_MAX)).ns(), FrameRate::kFarthestNs);
}

template <class A, class B>
concept Addable = requires(A a, B b) {
  a + b;
};

TEST(Units, TwoUnits_NeverMix) {
  static_assert(Addable<Instant, Duration>);
  static_assert(!Addable<Instant, Instant>);
  static_assert(!Addable<Duration, Exposure>);
  static_assert(!std::is_convertible_v<std::int64_t, Duration>);
  static_assert(!std::is_convertible_v<Gain, Exposure>);
}

}  // namespace
}  // namespace nodal
