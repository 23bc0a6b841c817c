#include "firmware/sync/pulse_watch.h"

#include <gtest/gtest.h>

#include "hal/sim/scene/random.h"

namespace nodal::firmware {
namespace {

constexpr FrameRate kPulseRate{30000, 1001};
constexpr Duration kPulseJitter = Duration::microseconds(200);

/// A head on a line, with jitter of the pulses' and of the exposures' timestamps.
class Line {
 public:
  explicit Line(std::uint64_t seed = 1) : random_(seed, "line") { watch.restart(kPulseRate); }

  /// `count` pulses, of which the head has exposed every `every`-th `delay` later, and then `drift_ppm` more each
  /// second.
  void expose(int count, Duration delay, std::int64_t drift_ppm = 0, std::uint64_t every = 1) {
    for (int i = 0; i < count; ++i, ++pulse_) {
      const Duration drifted =
          Duration::nanoseconds(kPulseRate.start_of(static_cast<std::uint64_t>(i)).us() * drift_ppm / 1000);
      if (pulse_ % every == 0) add(delay + drifted);
    }
  }
  void add(Duration skew) {
    const Duration period = kPulseRate.period();
    while (skew > period / 2) skew = skew - period;
    while (skew < -(period / 2)) skew = skew + period;
    watch.add(pulse_, skew + random_.around_zero(kPulseJitter) + random_.around_zero(kPulseJitter), sequence_++);
  }
  std::uint64_t pulse() const { return pulse_; }

  PulseWatch watch;

 private:
  hal::sim::Random random_;
  std::uint64_t pulse_ = 0;
  std::uint32_t sequence_ = 0xfffffff0U;  // wraps
};

TEST(PulseWatch, FewExposures_ItDoesNotKnow) {
  Line line;
  line.expose(60, Duration::milliseconds(2));
  EXPECT_EQ(line.watch.state(), Following::kUnknown);
  EXPECT_EQ(line.watch.drift_ppb(), 0);
}

TEST(PulseWatch, ConstantDelayWithJitter_FollowsForHours) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Line line(seed);
    line.expose(70, Duration::milliseconds(12));
    for (int second = 0; second < 3600; ++second) {
      line.expose(30, Duration::milliseconds(12));
      ASSERT_EQ(line.watch.state(), Following::kFollows) << "seed " << seed << ", second " << second;
    }
  }
}

TEST(PulseWatch, OwnClock_IsReportedWithItsDrift) {
  for (const std::int64_t ppm : {-20'000, -100, -50, -20, 20, 50, 100, 1000, 20'000}) {
    Line line;
    line.expose(600, Duration::milliseconds(3), ppm);
    EXPECT_EQ(line.watch.state(), Following::kDrifts) << ppm;
    // Three standard deviations of two means of 256 delays, which are 8.5 s apart: 3.6 ppm * sqrt(2).
    EXPECT_NEAR(line.watch.drift_ppb() / 1000.0, static_cast<double>(ppm), 5.1) << ppm;
  }
}

TEST(PulseWatch, ClockOf50Ppm_IsDetectedWithin8Seconds) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Line line(seed);
    line.expose(8 * 30, Duration::milliseconds(3), 50);
    EXPECT_EQ(line.watch.state(), Following::kDrifts) << "seed " << seed;
  }
}

TEST(PulseWatch, CablePulledAfterMinutes_IsDetectedWithin8SecondsAndForgottenAfterItIsBack) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Line line(seed);
    line.expose(5'000, Duration::milliseconds(3));
    ASSERT_EQ(line.watch.state(), Following::kFollows);
    line.expose(8 * 30, Duration::milliseconds(3), -50);
    EXPECT_EQ(line.watch.state(), Following::kDrifts) << "seed " << seed;
    line.expose(20 * 30, Duration::milliseconds(3));
    EXPECT_EQ(line.watch.state(), Following::kFollows) << "seed " << seed;
  }
}

TEST(PulseWatch, DelayJumpsOnce_MeasuresAgain) {
  Line line;
  line.expose(1'000, Duration::milliseconds(3));
  line.expose(10, Duration::milliseconds(12));
  EXPECT_EQ(line.watch.state(), Following::kUnknown);
  line.expose(70, Duration::milliseconds(12));
  EXPECT_EQ(line.watch.state(), Following::kFollows);
}

// A driver that reports a new exposure time three frames too late.
TEST(PulseWatch, DelayJumpsAndReturns_IsNoDrift) {
  Line line;
  line.expose(1'000, Duration::milliseconds(3));
  line.expose(3, Duration::milliseconds(7));
  for (int i = 0; i < 600; ++i) {
    line.expose(1, Duration::milliseconds(3));
    ASSERT_NE(line.watch.state(), Following::kDrifts) << i;
  }
  EXPECT_EQ(line.watch.state(), Following::kFollows);
}

// 25 frames per second: 6.6 ms later from frame to frame.
TEST(PulseWatch, AnotherRate_IsDrift) {
  Line line;
  line.expose(200, {}, 200'000);
  EXPECT_EQ(line.watch.state(), Following::kDrifts);
  EXPECT_NEAR(line.watch.drift_ppb() / 1e6, 200, 1);
}

TEST(PulseWatch, EverySecondPulse_IsSkippingAndOneLostFrameIsNot) {
  Line line;
  line.expose(100, Duration::milliseconds(3), 0, 2);
  EXPECT_EQ(line.watch.state(), Following::kSkipsPulses);
  line.expose(100, Duration::milliseconds(3));
  EXPECT_EQ(line.watch.state(), Following::kFollows);
  line.expose(1, Duration::milliseconds(3), 0, 1'000'000);  // lost, and not counted by the device
  line.expose(4, Duration::milliseconds(3));
  EXPECT_EQ(line.watch.state(), Following::kFollows);
}

// A head that was unplugged for a day; a rig of one frame in 1000 s; the largest numbers.
TEST(PulseWatch, PausesAndEndsOfTheRanges_AreNoDrift) {
  Line line;
  line.expose(100, Duration::milliseconds(3));
  line.watch.add(line.pulse() + 86'400 * 30, Duration::milliseconds(3), 5);
  EXPECT_EQ(line.watch.state(), Following::kUnknown);
  for (const FrameRate rate : {FrameRate{1, 1000}, FrameRate{1000, 1}, FrameRate{1'000'000, 999'999}}) {
    PulseWatch watch;
    watch.restart(rate);
    const std::uint64_t last = rate.first_after(Duration::nanoseconds(FrameRate::kFarthestNs)) - 200;
    for (std::uint64_t n = last; n < last + 150; ++n) watch.add(n, rate.period() / 4, static_cast<std::uint32_t>(n));
    EXPECT_EQ(watch.state(), Following::kFollows);
    watch.add(UINT64_MAX, -(rate.period() / 2), 0);
    watch.add(UINT64_MAX, rate.period() / 2, 0);
    EXPECT_EQ(watch.state(), Following::kUnknown);
  }
}

}  // namespace
}  // namespace nodal::firmware
