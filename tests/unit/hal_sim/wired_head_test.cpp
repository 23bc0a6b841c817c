#include <gtest/gtest.h>

#include <vector>

#include "hal/sim/rig.h"
#include "tests/support/rigs.h"

namespace nodal::hal::sim {
namespace {

constexpr Duration kWirePeriod = FrameRate{}.period();

// The sequence numbers of the pulses that started the frames; -1: the head's own clock did.
std::vector<int> pulses_of(SimHead& head, const std::vector<FrameView>& frames) {
  std::vector<int> pulses;
  for (const FrameView& frame : frames) {
    const auto pulse = head.truth_of(frame.sequence)->pulse;
    pulses.push_back(pulse ? static_cast<int>(*pulse) : -1);
  }
  return pulses;
}

/// A small head that follows the line 5 ms later; its own clock is slow by 100 ppm.
class WiredHead : public testing::Test {
 protected:
  WiredHead() : world_(test::ring(1, 16, 16), drifting()), port_(world_.enumerator().open("sim:cam0").value()) {
    EXPECT_TRUE(port_->start(TriggerMode::kWired));
    periods(4);
    EXPECT_TRUE(world_.trigger().start({}));
    periods(4);
  }
  static SimRigOptions drifting() {
    SimRigOptions options;
    options.scene = constant_scene({0.5F, 0.5F, 0.5F});
    options.head.pixels = PixelFormat::kGrey8;
    options.head.limits.has_trigger_input = false;
    options.head.free_run_phase = Duration{};
    options.head.trigger_latency = Duration::milliseconds(5);
    options.head.trigger_jitter = {};
    options.head.free_run_drift_ppm = 100;
    return options;
  }
  SimHead& head() { return world_.head(0); }
  /// The frames of the next `n` periods.
  std::vector<FrameView> periods(int n) {
    std::vector<FrameView> frames;
    for (const Instant end = world_.clock().now() + kWirePeriod * n; world_.clock().now() < end;) {
      world_.clock().advance(kWirePeriod);
      while (const auto frame = port_->take_frame().value()) {
        port_->release(frame->slot);
        frames.push_back(*frame);
      }
    }
    return frames;
  }
  void expect_conserved() {
    const HeadCounts& c = head().counts();
    EXPECT_EQ(c.exposed, c.taken + c.without_buffer + c.discarded + c.waiting);
  }

  SimRig world_;
  std::unique_ptr<HeadPort> port_;
};

TEST_F(WiredHead, Pulses_StartItsExposuresAfterItsOwnDelay) {
  const std::vector<FrameView> frames = periods(20);
  const std::vector<int> pulses = pulses_of(head(), frames);
  ASSERT_GE(frames.size(), 19U);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    ASSERT_EQ(pulses[i], pulses[i - 1] + 1);
    const Duration apart = FrameRate{}.start_of(static_cast<std::uint64_t>(pulses[i])) -
                           FrameRate{}.start_of(static_cast<std::uint64_t>(pulses[i - 1]));
    EXPECT_EQ(frames[i].mid_exposure - frames[i - 1].mid_exposure, apart);
  }
  expect_conserved();
}

TEST_F(WiredHead, CablePulled_ItsOwnClockGoesOnAndPulsesTakeOverAgain) {
  periods(5);
  head().set_cable(false);
  periods(3);
  const std::vector<FrameView> free = periods(100);
  ASSERT_NEAR(static_cast<double>(free.size()), 100, 1);
  for (const int pulse : pulses_of(head(), {free.end() - 40, free.end()})) EXPECT_EQ(pulse, -1);
  const Duration took = free.back().mid_exposure - free.front().mid_exposure;
  const double nominal = static_cast<double>(free.size() - 1) * static_cast<double>(kWirePeriod.ns());
  EXPECT_NEAR(static_cast<double>(took.ns()), nominal * (1 + 100e-6), 1000);
  head().set_cable(true);
  periods(3);
  for (const int pulse : pulses_of(head(), periods(20))) EXPECT_GT(pulse, 100);
  expect_conserved();
}

TEST_F(WiredHead, HalfRate_ExposesOnEverySecondPulseOnly) {
  head().set_pulses_an_exposure(2);
  periods(4);
  const std::vector<int> pulses = pulses_of(head(), periods(40));
  ASSERT_NEAR(static_cast<double>(pulses.size()), 20, 1);
  for (std::size_t i = 1; i < pulses.size(); ++i) EXPECT_EQ(pulses[i], pulses[i - 1] + 2);
  expect_conserved();
}

TEST_F(WiredHead, TriggerStops_ItStreamsOnWithoutARestart) {
  const auto before = periods(2);
  world_.trigger().stop();
  const auto after = periods(20);
  EXPECT_GE(after.size(), 19U);
  EXPECT_EQ(after.front().sequence, before.back().sequence + 1);
}

}  // namespace
}  // namespace nodal::hal::sim
