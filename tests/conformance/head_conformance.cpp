#include "head_conformance.h"

#include <set>
#include <vector>

#include "protocol/base/sha256.h"

namespace nodal::hal {

namespace {

Sha256 content(const FrameView& frame) {
  // Planes may have any layout, so pictures are compared sample by sample.
  std::vector<std::uint8_t> samples;
  for (const PlaneView& plane : frame.image.planes) {
    if (plane.data == nullptr) continue;
    for (int y = 0; y < plane.height; ++y) {
      const std::uint8_t* row = plane.data + y * plane.row_stride;
      for (int x = 0; x < plane.width; ++x) samples.push_back(row[x * plane.pixel_stride]);
    }
  }
  return sha256(samples);
}

Exposure another(const HeadLimits& limits, Exposure than) {
  const Exposure middle = Exposure::of((limits.exposure_min.duration() + limits.exposure_max.duration()) / 2);
  return middle == than ? limits.exposure_max : middle;
}

}  // namespace

std::unique_ptr<HeadPort> HeadConformance::open() {
  auto head = world_->enumerator().open(world_->path());
  if (!head) throw std::runtime_error(head.error().text());
  return std::move(*head);
}

std::unique_ptr<HeadPort> HeadConformance::open_streaming() {
  auto head = open();
  const Status started = head->start(TriggerMode::kFreeRun);
  if (!started) throw std::runtime_error(started.error().text());
  return head;
}

FrameView HeadConformance::next(HeadPort& head) {
  const Duration step = head.format().rate.period() / 8;
  for (int i = 0; i < 8 * 10; ++i) {
    auto frame = head.take_frame();
    if (!frame) throw std::runtime_error(frame.error().text());
    if (*frame) return **frame;
    world_->pass(step);
  }
  throw std::runtime_error("no frame came in ten periods");
}

TEST_P(HeadConformance, Opened_SaysWhoItIsAndWhatItSends) {
  const auto head = open();
  EXPECT_EQ(head->identity().path, world_->path());
  EXPECT_GT(head->format().width, 0);
  EXPECT_GT(head->format().height, 0);
  EXPECT_GT(head->format().rate.numerator, 0U);
  EXPECT_LE(head->limits().exposure_min, head->limits().exposure_max);
  EXPECT_LE(head->limits().gain_min, head->limits().gain_max);
  EXPECT_GE(head->limits().control_latency_frames, 0);
}

TEST_P(HeadConformance, Listed_TheHeadIsThereByItsPath) {
  const auto head = open();
  bool present = false;
  for (const HeadIdentity& identity : world_->enumerator().list()) present |= identity.path == world_->path();
  EXPECT_TRUE(present);
}

TEST_P(HeadConformance, OpenedTwice_SecondIsBusyAndNamesTheHead) {
  const auto first = open();
  const auto second = world_->enumerator().open(world_->path());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kBusy);
  EXPECT_NE(second.error().message.find(world_->path()), std::string::npos);
}

TEST_P(HeadConformance, Closed_CanBeOpenedAgain) {
  open_streaming().reset();
  const auto again = open_streaming();
  EXPECT_EQ(next(*again).verdict, FrameVerdict::kGood);
}

TEST_P(HeadConformance, UnknownPath_NoSuchDeviceAndNamesIt) {
  const auto head = world_->enumerator().open(world_->path() + "-not-there");
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kNoSuchDevice);
  EXPECT_NE(head.error().message.find("-not-there"), std::string::npos);
}

TEST_P(HeadConformance, NotStarted_TakingAFrameIsWrongState) {
  const auto head = open();
  const auto frame = head->take_frame();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, Errc::kWrongState);
}

TEST_P(HeadConformance, StartedTwice_SecondIsRefusedAndFramesGoOnComing) {
  const auto head = open_streaming();
  const Status second = head->start(TriggerMode::kFreeRun);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::kWrongState);
  EXPECT_EQ(next(*head).verdict, FrameVerdict::kGood);
}

TEST_P(HeadConformance, StoppedInAnyStateAnyNumberOfTimes_StartsAgain) {
  const auto head = open();
  head->stop();
  head->stop();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  head->stop();
  head->stop();
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  EXPECT_EQ(next(*head).verdict, FrameVerdict::kGood);
}

// Stops after Fibonacci numbers of frames: between frames, with and without lent frames, directly after a start.
TEST_P(HeadConformance, StoppedAfterManyCountsOfFrames_EveryRestartDeliversGoodFrames) {
  const auto head = open();
  for (const int count : {1, 2, 3, 5, 8, 13, 21, 34, 55, 89}) {
    ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
    for (int i = 0; i < count; ++i) {
      const FrameView frame = next(*head);
      ASSERT_EQ(frame.verdict, FrameVerdict::kGood) << "frame " << i << " of " << count;
      if (i + 1 < count || count % 2 == 0) head->release(frame.slot);  // odd counts stop with one frame lent
    }
    head->stop();
  }
}

TEST_P(HeadConformance, Frames_AreInOrderOfTimeAndAsTheFormatSays) {
  const auto head = open_streaming();
  std::optional<FrameView> last;
  for (int i = 0; i < 30; ++i) {
    const FrameView frame = next(*head);
    EXPECT_EQ(frame.image.format, head->format().pixels);
    EXPECT_EQ(frame.image.width, head->format().width);
    EXPECT_EQ(frame.image.height, head->format().height);
    EXPECT_NE(frame.image.planes[0].data, nullptr);
    EXPECT_LE(frame.mid_exposure, frame.received);
    EXPECT_LE(frame.received, world_->clock().now());
    if (last) {
      EXPECT_EQ(frame.sequence, last->sequence + 1);
      EXPECT_GT(frame.mid_exposure, last->mid_exposure);
    }
    last = frame;
    head->release(frame.slot);
  }
}

TEST_P(HeadConformance, FreeRun_ComesAtTheFormatsRate) {
  const auto head = open_streaming();
  const FrameView first = next(*head);
  head->release(first.slot);
  FrameView frame = first;
  for (int i = 0; i < 60; ++i) {
    frame = next(*head);
    head->release(frame.slot);
  }
  const double period = static_cast<double>(head->format().rate.period().ns());
  const double seen = static_cast<double>((frame.mid_exposure - first.mid_exposure).ns()) / 60;
  EXPECT_NEAR(seen / period, 1.0, 0.002);
}

TEST_P(HeadConformance, EveryBufferLent_SlotsAreDistinctAndWhatTheyHoldStays) {
  const auto head = open_streaming();
  std::vector<FrameView> lent;
  std::vector<Sha256> contents;
  for (int i = 0; i < 40; ++i) {
    world_->pass(head->format().rate.period());
    auto frame = head->take_frame();
    ASSERT_TRUE(frame);
    if (!*frame) continue;
    lent.push_back(**frame);
    contents.push_back(content(lent.back()));
  }
  ASSERT_GE(lent.size(), 2U);
  ASSERT_LT(lent.size(), 40U) << "a head has a bounded number of buffers";
  std::set<BufferSlot> slots;
  for (std::size_t i = 0; i < lent.size(); ++i) {
    EXPECT_TRUE(slots.insert(lent[i].slot).second);
    EXPECT_EQ(content(lent[i]), contents[i]);
  }
}

TEST_P(HeadConformance, NothingReleasedForAWhile_FramesAreLostAndTheSequenceSaysSo) {
  const auto head = open_streaming();
  std::vector<FrameView> lent;
  for (int i = 0; i < 40; ++i) {
    world_->pass(head->format().rate.period());
    if (auto frame = head->take_frame(); frame && *frame) lent.push_back(**frame);
  }
  ASSERT_FALSE(lent.empty());
  for (const FrameView& frame : lent) head->release(frame.slot);
  const FrameView after = next(*head);
  EXPECT_EQ(after.verdict, FrameVerdict::kGood);
  EXPECT_GT(after.sequence, lent.back().sequence + 1);
}

TEST_P(HeadConformance, ReleasedWrongly_NothingHappens) {
  const auto head = open_streaming();
  const FrameView frame = next(*head);
  head->stop();
  head->release(frame.slot);  // stop() has taken it back already
  head->release(0xFFFF);
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  const FrameView again = next(*head);
  head->release(again.slot);
  head->release(again.slot);
  EXPECT_EQ(next(*head).verdict, FrameVerdict::kGood);
}

TEST_P(HeadConformance, ExposureSetWhileStreaming_CarriedAfterTheStatedLatencyAndKept) {
  const auto head = open_streaming();
  const HeadLimits& limits = head->limits();
  if (limits.exposure_min == limits.exposure_max) GTEST_SKIP() << "this head's exposure is fixed";
  FrameView frame = next(*head);
  head->release(frame.slot);
  const Exposure before = frame.in_effect.exposure;
  const Exposure wanted = another(limits, before);
  const Instant set_at = world_->clock().now();
  ASSERT_TRUE(head->set_exposure(wanted));
  int begun_after = 0;
  for (int i = 0; i < limits.control_latency_frames + 12; ++i) {
    frame = next(*head);
    head->release(frame.slot);
    const Instant begin = frame.mid_exposure - frame.in_effect.exposure.duration() / 2;
    const bool due = begin >= set_at && begun_after++ >= limits.control_latency_frames;
    EXPECT_EQ(frame.in_effect.exposure, due ? wanted : before) << "frame " << i;
  }
  EXPECT_GT(begun_after, limits.control_latency_frames);
}

TEST_P(HeadConformance, NudgedInFreeRun_LaterExposuresMoveByWhatFramesSayWithinTheLimitsAndAfterTheLatency) {
  const auto head = open_streaming();
  const NudgeLimits& limits = head->limits().nudge;
  if (!limits.possible()) {
    const Status refused = head->nudge(Duration::milliseconds(1));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kUnsupported);
    EXPECT_NE(refused.error().message.find(world_->path()), std::string::npos);
    return;
  }
  const Duration period = head->format().rate.period();
  for (const Duration by : {limits.longest + limits.step * 3, limits.shortest - limits.step * 2}) {
    if ((by < Duration() ? limits.shortest : limits.longest) == Duration()) continue;
    FrameView frame = next(*head);
    head->release(frame.slot);
    const Instant asked_at = world_->clock().now();
    const Duration before = frame.nudged;
    ASSERT_TRUE(head->nudge(by));
    Instant last = frame.mid_exposure;
    Duration nudged = before;
    int begun_after = 0;
    for (int i = 0; i < limits.latency_frames + 12; ++i, last = frame.mid_exposure, nudged = frame.nudged) {
      frame = next(*head);
      head->release(frame.slot);
      const Duration longer = frame.nudged - nudged;
      const Duration off = frame.mid_exposure - last - period - longer;
      EXPECT_TRUE(off >= Duration::microseconds(-20) && off <= Duration::microseconds(20)) << off.ns() << " ns, " << i;
      EXPECT_LE(longer, limits.longest);
      EXPECT_GE(longer, limits.shortest);
      EXPECT_EQ(longer.ns() % limits.step.ns(), 0);
      const Instant begin = frame.mid_exposure - frame.in_effect.exposure.duration() / 2;
      const bool due = begin >= asked_at && begun_after++ >= limits.latency_frames;
      EXPECT_EQ(frame.nudged != before, due) << "frame " << i;
    }
    EXPECT_EQ(frame.nudged - before, by);
  }
}

TEST_P(HeadConformance, NudgedWhenItDoesNotRunFree_WrongStateAndNothingMoves) {
  const auto head = open();
  const NudgeLimits& limits = head->limits().nudge;
  if (!limits.possible()) GTEST_SKIP() << "this head cannot be moved in time";
  EXPECT_EQ(head->nudge(limits.longest).error().code, Errc::kWrongState);
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  EXPECT_EQ(next(*head).nudged, Duration());
}

TEST_P(HeadConformance, GainAndBalanceSetWhileStopped_CarriedByTheFirstFrame) {
  const auto head = open();
  const HeadLimits& limits = head->limits();
  HeadSettings wanted;
  ASSERT_TRUE(head->set_gain(limits.gain_max));
  if (limits.has_white_balance) {
    wanted.white_balance = {5000, 3000};
    ASSERT_TRUE(head->set_white_balance(wanted.white_balance));
  }
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  const FrameView frame = next(*head);
  EXPECT_EQ(frame.in_effect.gain, limits.gain_max);
  EXPECT_EQ(frame.in_effect.white_balance, wanted.white_balance);
}

TEST_P(HeadConformance, ValuesOutsideTheLimits_RefusedByNameAndNothingChanges) {
  const auto head = open_streaming();
  const HeadLimits& limits = head->limits();
  FrameView frame = next(*head);
  head->release(frame.slot);
  const HeadSettings before = frame.in_effect;
  const Duration step = Duration::nanoseconds(1);
  const std::vector<Status> refused{
      head->set_exposure(Exposure::of(limits.exposure_max.duration() + step)),
      head->set_exposure(Exposure::of(limits.exposure_min.duration() - step)),
      head->set_exposure(Exposure::microseconds(-1)),
      head->set_gain(Gain::millidecibels(limits.gain_max.mdb() + 1)),
      head->set_gain(Gain::millidecibels(limits.gain_min.mdb() - 1)),
  };
  for (const Status& status : refused) {
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, Errc::kBadValue);
    EXPECT_NE(status.error().message.find(world_->path()), std::string::npos) << status.error().message;
  }
  for (int i = 0; i < limits.control_latency_frames + 4; ++i) {
    frame = next(*head);
    head->release(frame.slot);
    EXPECT_EQ(frame.in_effect, before);
  }
}

TEST_P(HeadConformance, NoWhiteBalance_SettingItIsUnsupported) {
  const auto head = open();
  if (head->limits().has_white_balance) GTEST_SKIP() << "this head has white balance";
  const Status status = head->set_white_balance({5000, 3000});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kUnsupported);
}

TEST_P(HeadConformance, ExternalTrigger_OneFrameAPulseAndNoneWithout) {
  const auto head = open();
  TriggerPort* trigger = world_->trigger();
  if (!head->limits().has_trigger_input || trigger == nullptr) GTEST_SKIP() << "this head is not triggered";
  ASSERT_TRUE(head->start(TriggerMode::kExternal));
  const Duration period = head->format().rate.period();
  world_->pass(period * 5);
  const auto early = head->take_frame();
  ASSERT_TRUE(early);
  EXPECT_FALSE(*early) << "no pulse, no frame";

  TriggerSettings settings;
  settings.rate = head->format().rate;
  ASSERT_TRUE(trigger->start(settings));
  std::vector<Instant> pulses;
  std::vector<Instant> frames;
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
  ASSERT_LE(frames.size(), pulses.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_LT(std::abs((frames[i] - pulses[i]).us()), period.us() / 4) << "frame " << i << " is not pulse " << i;
  }
}

TEST_P(HeadConformance, NoTriggerInput_ExternalIsUnsupported) {
  const auto head = open();
  if (head->limits().has_trigger_input) GTEST_SKIP() << "this head has a trigger input";
  const Status status = head->start(TriggerMode::kExternal);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kUnsupported);
}

TEST_P(HeadConformance, UnpluggedWhileStreaming_EveryCallSaysSoByNameAndLentFramesStayReadable) {
  const auto head = open_streaming();
  const FrameView lent = next(*head);
  const Sha256 held = content(lent);
  if (!world_->unplug()) GTEST_SKIP() << "this head cannot be unplugged here";
  world_->pass(head->format().rate.period() * 3);
  // Earlier frames may still be taken.
  auto frame = head->take_frame();
  for (int i = 0; i < 64 && frame; ++i) frame = head->take_frame();
  const std::vector<Status> statuses{frame ? Status{} : fail(frame.error()),
                                     head->set_exposure(head->limits().exposure_max),
                                     head->set_gain(head->limits().gain_max), head->start(TriggerMode::kFreeRun)};
  for (const Status& status : statuses) {
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, Errc::kDeviceGone);
    EXPECT_NE(status.error().message.find(world_->path()), std::string::npos) << status.error().message;
  }
  EXPECT_EQ(content(lent), held);
  head->release(lent.slot);
  head->stop();
  const auto again = world_->enumerator().open(world_->path());
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, Errc::kNoSuchDevice);
}

TEST_P(HeadConformance, PluggedInAgain_OpensByItsPathWhileTheOldObjectStaysGone) {
  const auto old = open_streaming();
  next(*old);
  if (!world_->unplug()) GTEST_SKIP() << "this head cannot be unplugged here";
  if (!world_->replug()) GTEST_SKIP() << "this head cannot be plugged in again here";
  const auto fresh = open_streaming();
  EXPECT_EQ(fresh->identity().path, world_->path());
  EXPECT_EQ(next(*fresh).verdict, FrameVerdict::kGood);
  const auto frame = old->take_frame();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, Errc::kDeviceGone);
}

}  // namespace nodal::hal
