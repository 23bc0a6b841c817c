// How every head wakes the thread that takes its frames.
#include <algorithm>
#include <set>

#include "head_conformance.h"

namespace nodal::hal {
namespace {

/// How a thread waits for frames that sleeps until the port wakes it.
struct Watched {
  int frames = 0;
  int sleeps = 0;
  int overslept = 0;  ///< sleeps that nothing ended
  Duration latest;    ///< longest time from a frame's arrival until it was taken
  std::set<std::uint32_t> numbers;
};

Watched watch(HeadWorld& world, HeadPort& head, int frames) {
  Watched seen;
  const Duration period = head.format().rate.period();
  while (seen.frames < frames && seen.sleeps < frames * 20) {
    while (const auto frame = head.take_frame().value()) {
      ++seen.frames;
      seen.latest = std::max(seen.latest, world.clock().now() - frame->received);
      seen.numbers.insert(frame->sequence);
      head.release(frame->slot);
    }
    WakeUps wake_ups;
    head.add_wake_ups(wake_ups);
    ++seen.sleeps;
    if (!world.sleep(wake_ups, period * 8)) ++seen.overslept;
  }
  return seen;
}

void expect_watched_well(const Watched& seen, int frames) {
  EXPECT_GE(seen.frames, frames);
  EXPECT_EQ(seen.overslept, 0) << "a frame came, and its wake-up did not";
  EXPECT_LE(seen.sleeps, frames * 3 + 10) << "it wakes the thread for nothing";
  EXPECT_LE(seen.latest, Duration::milliseconds(1));
  EXPECT_EQ(*seen.numbers.rbegin() - *seen.numbers.begin() + 1, seen.numbers.size()) << "a frame was missed";
}

}  // namespace

TEST_P(HeadConformance, WakeUps_EveryFrameIsTakenWithinAMillisecondAndTheThreadSleepsInBetween) {
  const auto head = open_streaming();
  expect_watched_well(watch(*world_, *head, 34), 34);
}

TEST_P(HeadConformance, WakeUpsOfATriggeredHead_EveryFrameIsTakenWithinAMillisecond) {
  const auto head = open();
  TriggerPort* trigger = world_->trigger();
  if (!head->limits().has_trigger_input || trigger == nullptr) GTEST_SKIP() << "this head is not triggered";
  ASSERT_TRUE(head->start(TriggerMode::kExternal));
  TriggerSettings settings;
  settings.rate = head->format().rate;
  ASSERT_TRUE(trigger->start(settings));
  expect_watched_well(watch(*world_, *head, 34), 34);
  trigger->stop();
}

TEST_P(HeadConformance, Stopped_NothingWakesAThread) {
  const auto head = open_streaming();
  next(*head);
  head->stop();
  WakeUps wake_ups;
  head->add_wake_ups(wake_ups);
  EXPECT_FALSE(wake_ups.at());
  EXPECT_TRUE(wake_ups.descriptors().empty());
}

}  // namespace nodal::hal
