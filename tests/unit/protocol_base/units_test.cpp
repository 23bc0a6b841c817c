#include "protocol/base/units.h"

#include <gtest/gtest.h>

#include <type_traits>

namespace nodal {
namespace {

// A year of NTSC: the start of frame n is exact to the nanosecond, where adding up periods would drift.
TEST(FrameRate, AYearOfNtsc_StartOfFrameDoesNotDrift) {
  const FrameRate ntsc{30000, 1001};
  const std::uint64_t n = 30000ULL * 31557;  // 31557 * 1001 s, about a year
  EXPECT_EQ(ntsc.start_of(n), Duration::seconds(31557LL * 1001));
  EXPECT_EQ(ntsc.start_of(1).ns(), 33'366'666);
}

template <class A, class B>
concept Addable = requires(A a, B b) { a + b; };

TEST(Units, TwoUnits_NeverMix) {
  static_assert(Addable<Instant, Duration>);
  static_assert(!Addable<Instant, Instant>);
  static_assert(!Addable<Duration, Exposure>);
  static_assert(!std::is_convertible_v<std::int64_t, Duration>);
  static_assert(!std::is_convertible_v<Gain, Exposure>);
}

}  // namespace
}  // namespace nodal
