#include <algorithm>
#include <cstdlib>
#include <optional>
#include <vector>

#include "head_conformance.h"

namespace nodal::hal {

TEST_P(HeadConformance, WiredWithoutPulses_StreamsByItsOwnClockAndCannotBeMoved) {
  const auto head = open();
  ASSERT_TRUE(head->start(TriggerMode::kWired));
  const Duration period = head->format().rate.period();
  std::vector<Instant> middles;
  for (int i = 0; i < 4 * 100 && middles.size() < 12; ++i) {
    world_->pass(period / 4);
    while (const auto frame = head->take_frame().value()) {
      middles.push_back(frame->mid_exposure);
      head->release(frame->slot);
    }
  }
  ASSERT_GE(middles.size(), 12U);
  for (std::size_t i = 1; i < middles.size(); ++i) {
    EXPECT_LT(std::abs((middles[i] - middles[i - 1] - period).us()), period.us() / 4) << i;
  }
  const Status moved = head->nudge(Duration::milliseconds(1));
  ASSERT_FALSE(moved);
  const Errc expected = head->limits().nudge.possible() ? Errc::kWrongState : Errc::kUnsupported;
  EXPECT_EQ(moved.error().code, expected);
}

TEST_P(HeadConformance, WiredWithPulses_EveryFrameBeginsOneDelayAfterItsPulse) {
  TriggerPort* trigger = world_->trigger();
  if (trigger == nullptr) GTEST_SKIP() << "no line goes to this head";
  const auto head = open();
  ASSERT_TRUE(head->start(TriggerMode::kWired));
  const Duration period = head->format().rate.period();
  world_->pass(period * 5 / 3);
  TriggerSettings settings;
  settings.rate = head->format().rate;
  ASSERT_TRUE(trigger->start(settings));
  std::vector<Instant> pulses, frames;
  for (int i = 0; i < 8 * 30; ++i) {
    world_->pass(period / 8);
    while (auto edge = trigger->take_edge().value()) pulses.push_back(edge->at);
    while (auto frame = head->take_frame().value()) {
      frames.push_back(frame->mid_exposure - frame->in_effect.exposure.duration() / 2);
      head->release(frame->slot);
    }
  }
  trigger->stop();
  ASSERT_GE(frames.size(), 25U);
  ASSERT_GE(pulses.size(), 25U);
  // Frames before the first pulses, and one that was being exposed then, began by the head's own clock.
  std::optional<Duration> delay;
  for (std::size_t i = frames.size() - 20; i < frames.size(); ++i) {
    const auto nearest = std::min_element(pulses.begin(), pulses.end(), [&](Instant a, Instant b) {
      return std::abs((a - frames[i]).ns()) < std::abs((b - frames[i]).ns());
    });
    if (!delay) delay = frames[i] - *nearest;
    EXPECT_LT(std::abs(delay->us()), period.us() / 4);
    EXPECT_LT(std::abs((frames[i] - *nearest - *delay).us()), 100) << "frame " << i;
    EXPECT_LT(std::abs((frames[i] - frames[i - 1] - period).us()), 200) << "frame " << i;
  }
}

}  // namespace nodal::hal
