#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "hal/sim/rig.h"
#include "tests/support/rigs.h"

namespace nodal::hal::sim {
namespace {

constexpr Duration kPeriod = FrameRate{}.period();

/// A rig of small heads, one of them streaming.
class StreamingHead : public testing::Test {
 protected:
  explicit StreamingHead(TriggerMode mode = TriggerMode::kFreeRun, const HeadOptions& head = small())
      : world_(test::ring(2, 16, 16), options(head)), port_(world_.enumerator().open("sim:cam0").value()) {
    EXPECT_TRUE(port_->start(mode));
  }
  static HeadOptions small() {
    HeadOptions head;
    head.pixels = PixelFormat::kGrey8;
    head.free_run_phase = Duration{};
    return head;
  }
  static SimRigOptions options(const HeadOptions& head) {
    SimRigOptions options;
    options.scene = constant_scene({0.5F, 0.5F, 0.5F});
    options.head = head;
    return options;
  }
  SimHead& head() { return world_.head(0); }
  /// Advances by a frame period and takes the frames that arrived.
  std::vector<FrameView> period(bool release = true) {
    world_.clock().advance(kPeriod);
    std::vector<FrameView> frames;
    while (auto frame = port_->take_frame().value()) {
      frames.push_back(*frame);
      if (release) port_->release(frame->slot);
    }
    return frames;
  }
  std::vector<FrameView> periods(int n) {
    std::vector<FrameView> all;
    for (int i = 0; i < n; ++i) {
      for (const FrameView& frame : period()) all.push_back(frame);
    }
    return all;
  }
  void expect_conserved() {
    const HeadCounts& c = head().counts();
    EXPECT_EQ(c.exposed + c.duplicated, c.taken + c.without_buffer + c.by_fault + c.discarded + c.waiting);
  }

  SimRig world_;
  std::unique_ptr<HeadPort> port_;
};

TEST_F(StreamingHead, LoseFrames_TheirNumbersAreMissing) {
  const std::uint32_t before = periods(3).back().sequence;
  head().lose_frames(2);
  const auto frames = periods(6);
  EXPECT_EQ(head().counts().by_fault, 2U);
  EXPECT_EQ(frames.back().sequence - before - frames.size(), 2U);
  expect_conserved();
}

TEST_F(StreamingHead, CorruptNextFrame_OneIsAndItsPixelsAreNot128) {
  head().corrupt_next_frame();
  const auto frames = periods(5);
  ASSERT_GE(frames.size(), 3U);
  EXPECT_EQ(frames[0].verdict, FrameVerdict::kCorrupt);
  for (std::size_t i = 1; i < frames.size(); ++i) EXPECT_EQ(frames[i].verdict, FrameVerdict::kGood);
}

TEST_F(StreamingHead, TearNextFrame_ItIsShortAndTheNextIsWholeAgain) {
  head().tear_next_frame();
  std::vector<FrameView> frames;
  while (frames.size() < 2) {
    for (const FrameView& frame : period()) {
      frames.push_back(frame);
      const std::uint8_t last = frame.image.planes[0].data[255];
      EXPECT_EQ(last, frames.size() == 1 ? 0 : 128);
    }
  }
  EXPECT_EQ(frames[0].verdict, FrameVerdict::kTorn);
  EXPECT_EQ(frames[0].image.bytes, 128U);
  EXPECT_EQ(frames[1].verdict, FrameVerdict::kGood);
  EXPECT_EQ(frames[1].image.bytes, 256U);
}

TEST_F(StreamingHead, DuplicateNextFrame_ItComesTwiceWithOneNumber) {
  periods(2);
  head().duplicate_next_frame();
  const auto frames = periods(4);
  int twice = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) twice += frames[i].sequence == frames[i - 1].sequence;
  EXPECT_EQ(twice, 1);
  expect_conserved();
}

TEST_F(StreamingHead, DelayNextFrame_ItIsLateButExposedInTime) {
  periods(2);
  head().delay_next_frame(Duration::milliseconds(15));
  const auto frames = periods(4);
  int late = 0;
  for (const FrameView& frame : frames) {
    const FrameTruth truth = head().truth_of(frame.sequence).value();
    EXPECT_EQ(frame.mid_exposure, truth.mid_exposure);
    late += frame.received - truth.exposure_begin > Duration::milliseconds(36);  // 10 exposure, 12 readout, 15 late
  }
  EXPECT_EQ(late, 1);
}

TEST_F(StreamingHead, SignalLost_FramesGoOnWithNoSignal) {
  periods(2);
  head().set_signal(false);
  auto frames = periods(4);
  EXPECT_EQ(frames.back().verdict, FrameVerdict::kNoSignal);
  head().set_signal(true);
  frames = periods(4);
  EXPECT_EQ(frames.back().verdict, FrameVerdict::kGood);
}

TEST_F(StreamingHead, SequenceSetToItsEnd_WrapsToZero) {
  head().set_sequence(0xFFFFFFFE);
  const auto frames = periods(6);
  ASSERT_GE(frames.size(), 4U);
  EXPECT_EQ(frames[0].sequence, 0xFFFFFFFE);
  EXPECT_EQ(frames[1].sequence, 0xFFFFFFFF);
  EXPECT_EQ(frames[2].sequence, 0U);
}

TEST_F(StreamingHead, StoppedWithFramesWaiting_TheyAreCountedAsDiscarded) {
  world_.clock().advance(kPeriod * 3);
  port_->stop();
  EXPECT_EQ(head().counts().taken, 0U);
  EXPECT_EQ(head().counts().discarded, head().counts().exposed);
  EXPECT_EQ(head().counts().waiting, 0U);
}

TEST_F(StreamingHead, NobodyTakesForAnHour_FourWaitAndTheRestIsCounted) {
  world_.clock().advance(Duration::seconds(3600));
  const auto frame = port_->take_frame().value();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 0U) << "the oldest are kept, as a driver does";
  EXPECT_NEAR(static_cast<double>(head().counts().without_buffer), 3600 * 30000 / 1001.0 - 4, 3);
  expect_conserved();
}

class TriggeredHead : public StreamingHead {
 protected:
  TriggeredHead() : StreamingHead(TriggerMode::kExternal, slow()) {}
  static HeadOptions slow() {
    HeadOptions head = small();
    head.trigger_latency = Duration::microseconds(80);
    head.trigger_jitter = Duration::microseconds(5);
    return head;
  }
};

TEST_F(TriggeredHead, Pulsed_ExposesAfterItsLatencyWithinItsJitter) {
  ASSERT_TRUE(world_.trigger().start({}));
  std::set<std::int64_t> offsets;
  int frames = 0;
  for (int i = 0; i < 100; ++i) {
    const auto taken = period();
    std::vector<TriggerEdge> edges;
    while (auto edge = world_.trigger().take_edge().value()) edges.push_back(*edge);
    for (const FrameView& frame : taken) {
      const FrameTruth truth = head().truth_of(frame.sequence).value();
      ASSERT_TRUE(truth.pulse);
      EXPECT_EQ(*truth.pulse, frame.sequence);
      EXPECT_EQ(truth.mid_exposure - truth.exposure_begin, Duration::milliseconds(5)) << "half of 10 ms";
      for (const TriggerEdge& edge : edges) {
        if (edge.number != *truth.pulse) continue;
        offsets.insert((truth.exposure_begin - edge.at).ns());
        ++frames;
      }
    }
  }
  ASSERT_GT(frames, 50);
  EXPECT_GE(*offsets.begin(), 75'000);
  EXPECT_LE(*offsets.rbegin(), 85'000);
  EXPECT_GT(offsets.size(), 20U) << "there is jitter";
}

TEST_F(TriggeredHead, ExposureLongerThanThePeriod_EverySecondPulseIsIgnored) {
  port_->stop();
  ASSERT_TRUE(port_->set_exposure(Exposure::microseconds(33'000)));
  ASSERT_TRUE(port_->start(TriggerMode::kExternal));
  TriggerSettings fast;
  fast.rate = {60, 1};
  ASSERT_TRUE(world_.trigger().start(fast));
  world_.clock().advance(Duration::seconds(2));
  static_cast<void>(port_->take_frame());
  EXPECT_NEAR(static_cast<double>(head().counts().pulses_ignored), 60, 1);
  EXPECT_NEAR(static_cast<double>(head().counts().exposed), 60, 1);
}

TEST_F(TriggeredHead, DelayedByTheTriggersSettings_ExposesThatMuchLater) {
  TriggerSettings settings;
  settings.delay[0] = Duration::milliseconds(4);
  ASSERT_TRUE(world_.trigger().start(settings));
  const auto frames = periods(6);
  const auto edge = world_.trigger().take_edge().value();
  ASSERT_FALSE(frames.empty());
  ASSERT_TRUE(edge);
  const FrameTruth truth = head().truth_of(0).value();
  EXPECT_NEAR(static_cast<double>((truth.exposure_begin - edge->at).us()), 4080, 6);
}

TEST(SimWorld, TenTriggeredHeads_ExposeTogether) {
  SimRigOptions options;
  options.scene = constant_scene({0.2F, 0.2F, 0.2F});
  SimRig world(test::ring(10, 16, 16), options);
  std::vector<std::unique_ptr<HeadPort>> ports;
  for (const HeadIdentity& identity : world.enumerator().list()) {
    ports.push_back(world.enumerator().open(identity.path).value());
    ASSERT_TRUE(ports.back()->start(TriggerMode::kExternal));
  }
  ASSERT_EQ(ports.size(), 10U);
  ASSERT_TRUE(world.trigger().start({}));
  world.clock().advance(Duration::milliseconds(120));
  std::vector<Instant> middles;
  for (const auto& port : ports) middles.push_back(port->take_frame().value().value().mid_exposure);
  const auto [first, last] = std::minmax_element(middles.begin(), middles.end());
  EXPECT_LE(*last - *first, Duration::microseconds(4)) << "twice the jitter";
  EXPECT_GT(*last - *first, Duration{});
}

TEST(SimWorld, FreeRunningHeadsThatDrift_PartByAsMuch) {
  SimRigOptions options;
  options.scene = constant_scene({0.2F, 0.2F, 0.2F});
  options.head.free_run_phase = Duration{};
  options.adjust = [](HeadIndex index, HeadOptions& head) { head.free_run_drift_ppm = index == 0 ? -50 : 50; };
  SimRig world(test::ring(2, 16, 16), options);
  auto a = world.enumerator().open("sim:cam0").value();
  auto b = world.enumerator().open("sim:cam1").value();
  ASSERT_TRUE(a->start(TriggerMode::kFreeRun));
  ASSERT_TRUE(b->start(TriggerMode::kFreeRun));
  FrameView last_a, last_b;
  for (int i = 0; i < 1000; ++i) {
    world.clock().advance(kPeriod);
    while (auto frame = a->take_frame().value()) a->release((last_a = *frame).slot);
    while (auto frame = b->take_frame().value()) b->release((last_b = *frame).slot);
  }
  // 100 ppm over 33 s.
  const auto apart = last_b.sequence == last_a.sequence ? last_b.mid_exposure - last_a.mid_exposure : Duration{};
  EXPECT_NEAR(static_cast<double>(apart.us()), 33.3 * 100, 20);
}

TEST(SimWorld, UnknownHead_ErrorNamesItAndThoseThereAre) {
  SimRig world(test::ring(2, 16, 16), {});
  const auto head = world.enumerator().open("sim:cam7");
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kNoSuchDevice);
  EXPECT_NE(head.error().message.find("sim:cam7"), std::string::npos);
  EXPECT_NE(head.error().message.find("sim:cam1"), std::string::npos);
}

struct Event {
  std::uint32_t sequence;
  std::int64_t mid, received;
  int verdict;
  friend bool operator==(const Event&, const Event&) = default;
};

/// A minute with every fault, polled every `poll`; no frame is held, so the polling interval must not matter.
std::vector<Event> minute(std::uint64_t seed, Duration poll) {
  SimRigOptions options;
  options.seed = seed;
  options.scene = constant_scene({0.5F, 0.5F, 0.5F});
  options.head.pixels = PixelFormat::kGrey8;
  options.head.buffers = 64;
  options.head.faults = {20'000, 20'000, 20'000, 50'000, 20'000, Duration::milliseconds(20)};
  options.trigger.jitter = Duration::microseconds(10);
  SimRig world(test::ring(3, 8, 8), options);
  auto port = world.enumerator().open("sim:cam1").value();
  EXPECT_TRUE(port->start(TriggerMode::kExternal));
  EXPECT_TRUE(world.trigger().start({}));
  std::vector<Event> events;
  const Instant end = world.clock().now() + Duration::seconds(60);
  while (world.clock().now() < end) {
    world.clock().advance_to(std::min(end, world.clock().now() + poll));
    while (auto frame = port->take_frame().value()) {
      events.push_back({frame->sequence, frame->mid_exposure.ns(), frame->received.ns(), int(frame->verdict)});
      port->release(frame->slot);
    }
  }
  return events;
}

TEST(SimWorld, SameSeed_SameMinuteHoweverItIsPolled) {
  const auto often = minute(42, Duration::milliseconds(3));
  EXPECT_GT(often.size(), 1700U);
  EXPECT_EQ(often, minute(42, Duration::milliseconds(3)));
  EXPECT_EQ(often, minute(42, Duration::milliseconds(700)));
  EXPECT_NE(often, minute(43, Duration::milliseconds(3)));
}

// After any sequence of operations on a head, every frame is accounted for.
RC_GTEST_PROP(SimHead, AnyHistory_FramesAreConserved, (std::vector<std::uint8_t> script)) {
  SimRigOptions options;
  options.scene = constant_scene({0.5F, 0.5F, 0.5F});
  options.head.pixels = PixelFormat::kGrey8;
  SimRig world(test::ring(1, 8, 8), options);
  SimHead& head = world.head(0);
  std::unique_ptr<HeadPort> port;
  std::vector<BufferSlot> lent;
  static_cast<void>(world.trigger().start({}));
  for (const std::uint8_t action : script) {
    const int what = action % 14;
    if (what == 0) world.clock().advance(Duration::milliseconds(action));
    if (what >= 1 && what <= 3) world.clock().advance(kPeriod);
    if (what == 9) head.lose_frames();
    if (what == 10) head.duplicate_next_frame();
    if (what == 11) head.unplug();
    if (what == 12) head.replug();
    if (what == 13) {
      if (auto opened = world.enumerator().open("sim:cam0")) {
        port = std::move(*opened);
        lent.clear();
      }
    }
    if (!port) continue;
    if (what == 4) static_cast<void>(port->start(action & 1 ? TriggerMode::kExternal : TriggerMode::kFreeRun));
    if (what == 5) port->stop();
    if (what == 6 || what == 7) {
      if (auto frame = port->take_frame(); frame && *frame) lent.push_back((**frame).slot);
    }
    if (what == 8 && !lent.empty()) {
      port->release(lent.back());
      lent.pop_back();
    }
    const HeadCounts& c = head.counts();
    RC_ASSERT(c.exposed + c.duplicated == c.taken + c.without_buffer + c.by_fault + c.discarded + c.waiting);
  }
}

/// A head that sees uniform light, with a linear curve, so that a level is proportional to the true exposure.
class SettingsInEffect : public StreamingHead, public testing::WithParamInterface<int> {
 protected:
  SettingsInEffect() : StreamingHead(TriggerMode::kFreeRun, with_latency(GetParam())) {}
  static HeadOptions with_latency(int frames) {
    HeadOptions head = small();
    head.limits.control_latency_frames = frames;
    return head;
  }
  FrameView next() {
    for (int i = 0; i < 4; ++i) {
      const auto frames = period();
      if (!frames.empty()) return frames.back();
    }
    ADD_FAILURE() << "no frame came";
    return {};
  }
  /// 255 light (exposure / 10 ms) gain, with light 0.5: the exposure that the picture itself shows.
  static double level_of(const HeadSettings& settings) {
    return 255 * 0.5 * static_cast<double>(settings.exposure.us()) / 10'000 *
           std::pow(10.0, settings.gain.mdb() / 20'000.0);
  }
};

TEST_P(SettingsInEffect, AChangeEveryFrame_EachFrameSaysWhatItsPixelsSayAndWhatWasAskedThenAndNotLast) {
  next();
  std::vector<Exposure> asked;
  for (int n = 0; n < 24; ++n) {
    const FrameView frame = next();
    EXPECT_NEAR(frame.image.planes[0].data[0], level_of(frame.in_effect), 1) << "frame " << n;
    // Requested after frame k was taken, just before frame k + 1 begins.
    const int carried = n - 1 - GetParam();
    if (carried >= 0) {
      EXPECT_EQ(frame.in_effect.exposure, asked[static_cast<std::size_t>(carried)]) << "frame " << n;
    }
    asked.push_back(Exposure::microseconds(1000 + 700 * ((n * 7) % 11)));
    ASSERT_TRUE(port_->set_exposure(asked.back()));
  }
}

TEST_P(SettingsInEffect, StuckExposure_FramesSayWhatTheyHaveAndNotWhatWasAsked) {
  const HeadSettings before = next().in_effect;
  head().set_stuck(true);
  ASSERT_TRUE(port_->set_exposure(Exposure::microseconds(2500)));
  ASSERT_TRUE(port_->set_gain(Gain::millidecibels(3000)));
  for (int i = 0; i < GetParam() + 6; ++i) {
    const FrameView frame = next();
    EXPECT_EQ(frame.in_effect, before);
    EXPECT_NEAR(frame.image.planes[0].data[0], level_of(before), 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Latencies, SettingsInEffect, testing::Values(0, 1, 2, 3, 4));

TEST_F(StreamingHead, Gamma_NumbersAreLightToOneOverItAndTheFrameSaysSo) {
  ASSERT_TRUE(port_->set_gamma(Gamma::thousandths(2200)));
  const FrameView frame = periods(6).back();
  EXPECT_EQ(frame.in_effect.gamma, Gamma::thousandths(2200));
  const auto again = period(false);
  ASSERT_FALSE(again.empty());
  EXPECT_NEAR(again.back().image.planes[0].data[0], 255 * std::pow(0.5, 1 / 2.2), 1);
  const Status refused = port_->set_gamma(Gamma::thousandths(9000));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadValue);
}

TEST(InterlacedHead, FieldsSwappedOrLost_TheFrameSaysSoAndTheNextIsWholeAgain) {
  SimRigOptions options;
  options.scene = constant_scene({0.5F, 0.5F, 0.5F});
  options.head.fields = Fields::kBottomFirst;
  options.head.free_run_phase = Duration{};
  SimRig world(test::ring(1, 16, 16), options);
  const auto port = world.enumerator().open("sim:cam0").value();
  EXPECT_EQ(port->format().fields, Fields::kBottomFirst);
  ASSERT_TRUE(port->start(TriggerMode::kFreeRun));
  world.head(0).swap_next_fields();
  std::vector<Fields> came;
  for (int n = 0; n < 8; ++n) {
    world.clock().advance(kPeriod);
    if (n == 3) world.head(0).lose_next_field();
    while (auto frame = port->take_frame().value()) {
      came.push_back(frame->fields);
      port->release(frame->slot);
    }
  }
  ASSERT_GE(came.size(), 5U);
  EXPECT_EQ(came[0], Fields::kTopFirst);
  EXPECT_EQ(came[1], Fields::kBottomFirst);
  EXPECT_EQ(std::count(came.begin(), came.end(), Fields::kBottomOnly), 1);
  EXPECT_EQ(came.back(), Fields::kBottomFirst);
}

}  // namespace
}  // namespace nodal::hal::sim
