// One head of the capture stage on a port that fails at every call in turn, and that sends frames of every fault.
#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <functional>
#include <set>

#include "firmware/capture/capture_head.h"

namespace nodal::firmware {
namespace {

/// What the port does; it outlives the ports that are opened.
struct Script {
  int fail_at = -1;  ///< the call, counted from 0, that fails
  Errc fail_with = Errc::kDeviceGone;
  int calls = 0;
  hal::HeadFormat format;
  hal::HeadLimits limits;
  std::deque<hal::FrameView> frames;
  std::multiset<std::string> done;  ///< successful calls
  std::set<hal::BufferSlot> lent;
  int failing_starts = 0;

  Status call(const std::string& name) {
    if (calls++ == fail_at) return fail(fail_with, name + " fails");
    done.insert(name);
    return {};
  }
};

class TroubledPort final : public hal::HeadPort {
 public:
  explicit TroubledPort(Script& script) : script_(script) {}
  const hal::HeadIdentity& identity() const override { return identity_; }
  const hal::HeadFormat& format() const override { return script_.format; }
  const hal::HeadLimits& limits() const override { return script_.limits; }
  Status start(hal::TriggerMode) override {
    if (script_.failing_starts > 0) {
      --script_.failing_starts;
      return fail(Errc::kDeviceFailed, "start fails");
    }
    return script_.call("start");
  }
  void stop() override { script_.lent.clear(); }
  Status set_exposure(Exposure) override { return script_.call("exposure"); }
  Status set_gain(Gain) override { return script_.call("gain"); }
  Status set_white_balance(WhiteBalance) override { return script_.call("white balance"); }
  Status set_gamma(hal::Gamma) override { return script_.call("gamma"); }
  Status nudge(Duration) override { return script_.call("nudge"); }
  Result<std::optional<hal::FrameView>> take_frame() override {
    if (Status taken = script_.call("take"); !taken) return fail(taken.error());
    if (script_.frames.empty()) return std::optional<hal::FrameView>();
    hal::FrameView frame = script_.frames.front();
    script_.frames.pop_front();
    script_.lent.insert(frame.slot);
    return std::optional(frame);
  }
  void add_wake_ups(hal::WakeUps&) const override {}
  void release(hal::BufferSlot slot) override { script_.lent.erase(slot); }

 private:
  Script& script_;
  const hal::HeadIdentity identity_;
};

class TroubledEnumerator final : public hal::HeadEnumerator {
 public:
  explicit TroubledEnumerator(Script& script) : script_(script) {}
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string&) override {
    if (Status opened = script_.call("open"); !opened) return fail(opened.error());
    return std::make_unique<TroubledPort>(script_);
  }
  std::vector<hal::HeadIdentity> list() override { return {}; }

 private:
  Script& script_;
};

class HeadTrouble : public testing::Test {
 protected:
  HeadTrouble() {
    script.format.pixels = PixelFormat::kGrey8;
    script.format.width = 8;
    script.format.height = 6;
    script.limits.exposure_min = Exposure::microseconds(100);
    script.limits.exposure_max = Exposure::microseconds(20'000);
    script.limits.gain_max = Gain::millidecibels(24'000);
    script.limits.has_white_balance = true;
    script.limits.gamma_min = hal::Gamma::thousandths(500);
    script.limits.gamma_max = hal::Gamma::thousandths(2500);
    script.limits.control_latency_frames = 2;
  }
  static HeadConfig config() {
    HeadConfig config;
    config.name = "cam0";
    config.exposure = Exposure::microseconds(8000);
    config.gain = Gain::millidecibels(3000);
    config.white_balance = WhiteBalance{};
    config.gamma = hal::Gamma::thousandths(1000);
    return config;
  }
  void stream() {
    for (int i = 0; i < 10 && !head.streaming(); ++i) step();
    ASSERT_TRUE(head.streaming());
  }
  bool step(Duration after = Duration::seconds(1)) {
    now = now + after;
    return head.step(now, hal::TriggerMode::kFreeRun);
  }
  hal::FrameView frame(hal::BufferSlot slot = 1) {
    hal::FrameView view;
    view.slot = slot;
    view.image = packed_image(script.format.pixels, script.format.width, script.format.height, bytes.data());
    view.in_effect.exposure = Exposure::microseconds(8000);
    view.in_effect.gain = Gain::millidecibels(3000);
    view.in_effect.gamma = hal::Gamma::thousandths(1000);
    return view;
  }
  std::uint64_t lost(LossReason reason) { return head.report().counts.losses[static_cast<std::size_t>(reason)]; }

  const std::vector<std::uint8_t> bytes = std::vector<std::uint8_t>(8 * 6);
  Script script;
  TroubledEnumerator enumerator{script};
  Instant now;
  CaptureHead head{config(), "test:cam0", enumerator};
};

TEST_F(HeadTrouble, TheDeviceGoesAtAnyCall_TheHeadComesBackWithAllItsSettings) {
  for (int k = 0; k < 12; ++k) {
    Script own;
    own.limits = script.limits;
    own.fail_at = k;
    TroubledEnumerator ports(own);
    CaptureHead one(config(), "test:cam0", ports);
    Instant at;
    for (int i = 0; i < 20; ++i) {
      at = at + Duration::seconds(1);
      one.step(at, hal::TriggerMode::kFreeRun);
      (void)one.take_frame();
      if (one.streaming()) one.nudge(Duration::microseconds(10));
    }
    EXPECT_TRUE(one.streaming()) << "call " << k << ": " << one.report().problem;
    EXPECT_TRUE(one.report().present) << "call " << k;
    EXPECT_TRUE(one.conserved()) << "call " << k;
    for (const char* setting : {"exposure", "gain", "white balance", "gamma"}) {
      EXPECT_GE(own.done.count(setting), 1u) << "call " << k << ": " << setting;
    }
  }
}

TEST_F(HeadTrouble, AStartThatFails_IsAProblemAndIsTriedAgainAfterItsInterval) {
  script.failing_starts = 1;
  step();  // opens
  step();  // starts, which fails
  EXPECT_FALSE(head.streaming());
  EXPECT_EQ(head.report().problem, "start fails");
  EXPECT_FALSE(step(Duration::milliseconds(199)));
  EXPECT_FALSE(head.streaming());
  EXPECT_TRUE(step(Duration::milliseconds(1)));
  EXPECT_TRUE(head.streaming());
  EXPECT_EQ(head.report().started_by, hal::TriggerMode::kFreeRun);
}

TEST_F(HeadTrouble, AnOpenThatFails_IsTriedAgainAfterItsIntervalAndNotBefore) {
  script.fail_at = 0;
  script.fail_with = Errc::kNoSuchDevice;
  EXPECT_FALSE(step());
  EXPECT_EQ(head.report().problem, "open fails");
  EXPECT_FALSE(step(Duration::milliseconds(199)));
  EXPECT_EQ(script.calls, 1);
  EXPECT_TRUE(step(Duration::milliseconds(1)));
  EXPECT_TRUE(head.report().present);
}

TEST_F(HeadTrouble, FramesOfEveryFault_AreLostUnderTheirReasonAndGivenBack) {
  stream();
  const auto takes = [&](const hal::FrameView& view, std::optional<LossReason> reason) {
    const std::uint64_t before = reason ? lost(*reason) : 0;
    script.frames.push_back(view);
    const auto taken = head.take_frame();
    EXPECT_EQ(taken.has_value(), !reason.has_value());
    if (!reason) return head.lose(*taken, LossReason::kLate);
    EXPECT_EQ(lost(*reason), before + 1);
    EXPECT_TRUE(script.lent.empty()) << "its buffer is the port's again";
  };
  takes(frame(), std::nullopt);
  for (int fault = 0; fault < 4; ++fault) {
    hal::FrameView wrong = frame();
    if (fault == 0) wrong.image.format = PixelFormat::kRggb8;
    if (fault == 1) ++wrong.image.width;
    if (fault == 2) ++wrong.image.height;
    if (fault == 3) wrong.image.planes[0].data = nullptr;
    takes(wrong, LossReason::kWrongFormat);
  }
  for (const auto& [verdict, reason] : {std::pair{hal::FrameVerdict::kCorrupt, LossReason::kCorrupt},
                                        {hal::FrameVerdict::kTorn, LossReason::kTorn},
                                        {hal::FrameVerdict::kNoSignal, LossReason::kNoSignal}}) {
    hal::FrameView wrong = frame();
    wrong.verdict = verdict;
    wrong.image.planes[0].data = nullptr;  // the port's verdict comes first
    takes(wrong, reason);
  }
  hal::FrameView one_field = frame();
  one_field.fields = Fields::kTopFirst;
  takes(one_field, LossReason::kFieldParity);
  script.format.fields = Fields::kBottomFirst;
  takes(one_field, LossReason::kFieldOrder);
  EXPECT_TRUE(head.conserved());
}

TEST_F(HeadTrouble, SettingsThatItDoesNotApply_AreReportedAfterItsLatencyAndFourFrames) {
  stream();
  SettingsChange change;
  change.exposure = Exposure::microseconds(4000);
  ASSERT_TRUE(head.change(change));
  const int kept = script.limits.control_latency_frames + 4;
  for (int i = 0; i < kept; ++i) {
    script.frames.push_back(frame());
    head.lose(*head.take_frame(), LossReason::kLate);
    EXPECT_EQ(head.report().ignores, "") << i;
    EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(4000)) << i;
  }
  script.frames.push_back(frame());
  head.lose(*head.take_frame(), LossReason::kLate);
  EXPECT_EQ(head.report().ignores,
            "does not apply its settings: in effect 8000 us, 3 dB; requested 4000 us; requested 3 dB");
  EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(8000)) << "it will not come";
  hal::FrameView applied = frame();
  applied.in_effect.exposure = Exposure::microseconds(4000);
  script.frames.push_back(applied);
  head.lose(*head.take_frame(), LossReason::kLate);
  EXPECT_EQ(head.report().ignores, "");
}

// The steps of heads are within 1/16 of an exposure, 400 mdB of gain, 0.05 of gamma and 1/16 of a white balance.
TEST_F(HeadTrouble, SettingsWithinTheStepsOfHeads_CountAsAppliedAndOthersDoNot) {
  stream();
  const auto ignored = [&](const std::function<void(hal::HeadSettings&)>& make) {
    hal::FrameView view = frame();
    make(view.in_effect);
    SettingsChange same;  // a request, from which frames are counted
    same.exposure = Exposure::microseconds(8000);
    EXPECT_TRUE(head.change(same));
    for (int i = 0; i < 10; ++i) {
      script.frames.push_back(view);
      head.lose(*head.take_frame(), LossReason::kLate);
    }
    const bool reported = !head.report().ignores.empty();
    script.frames.push_back(frame());
    head.lose(*head.take_frame(), LossReason::kLate);
    return reported;
  };
  EXPECT_FALSE(ignored([](auto& s) { s.exposure = Exposure::microseconds(8500); }));
  EXPECT_FALSE(ignored([](auto& s) { s.exposure = Exposure::microseconds(7500); }));
  EXPECT_TRUE(ignored([](auto& s) { s.exposure = Exposure::microseconds(8501); }));
  EXPECT_TRUE(ignored([](auto& s) { s.exposure = Exposure::microseconds(7499); }));
  EXPECT_FALSE(ignored([](auto& s) { s.gain = Gain::millidecibels(3400); }));
  EXPECT_TRUE(ignored([](auto& s) { s.gain = Gain::millidecibels(3401); }));
  EXPECT_TRUE(ignored([](auto& s) { s.gain = Gain::millidecibels(2599); }));
  EXPECT_FALSE(ignored([](auto& s) { s.gamma = hal::Gamma::thousandths(1050); }));
  EXPECT_TRUE(ignored([](auto& s) { s.gamma = hal::Gamma::thousandths(1051); }));
  EXPECT_FALSE(ignored([](auto& s) { s.white_balance = {4096 + 256, 4096 - 256}; }));
  EXPECT_TRUE(ignored([](auto& s) { s.white_balance = {4096 + 257, 4096}; }));
  EXPECT_TRUE(ignored([](auto& s) { s.white_balance = {4096, 4096 - 257}; }));
}

TEST_F(HeadTrouble, ASettingThatTheDeviceRefuses_IsAnErrorThatNamesTheHeadAndTheOthersStay) {
  stream();
  script.fail_at = script.calls;
  script.fail_with = Errc::kDeviceFailed;
  SettingsChange change;
  change.exposure = Exposure::microseconds(4000);
  change.gain = Gain::millidecibels(1000);
  const std::size_t gains = script.done.count("gain");
  const Status changed = head.change(change);
  ASSERT_FALSE(changed);
  EXPECT_EQ(changed.error().message, "head 'cam0': exposure fails");
  EXPECT_EQ(script.done.count("gain"), gains) << "nothing after the one that was refused";
  EXPECT_TRUE(head.streaming());
  script.frames.push_back(frame());
  head.lose(*head.take_frame(), LossReason::kLate);
  EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(8000)) << "the refused one is not wanted any more";
}

TEST_F(HeadTrouble, ANudgeThatFails_IsAProblemOnly) {
  stream();
  script.fail_at = script.calls;
  script.fail_with = Errc::kDeviceFailed;
  head.nudge(Duration::microseconds(10));
  EXPECT_EQ(head.report().problem, "nudge fails");
  EXPECT_TRUE(head.streaming());
}

TEST_F(HeadTrouble, ValuesAtTheLimits_AreAllowedAndOneBeyondIsRefused) {
  stream();
  const auto allowed = [&](const std::function<void(SettingsChange&)>& make) {
    SettingsChange change;
    make(change);
    return head.check(change).has_value();
  };
  for (const int us : {100, 20'000}) EXPECT_TRUE(allowed([&](auto& c) { c.exposure = Exposure::microseconds(us); }));
  for (const int us : {99, 20'001}) EXPECT_FALSE(allowed([&](auto& c) { c.exposure = Exposure::microseconds(us); }));
  for (const int mdb : {0, 24'000}) EXPECT_TRUE(allowed([&](auto& c) { c.gain = Gain::millidecibels(mdb); }));
  for (const int mdb : {-1, 24'001}) EXPECT_FALSE(allowed([&](auto& c) { c.gain = Gain::millidecibels(mdb); }));
  EXPECT_TRUE(allowed([](auto& c) { c.white_balance = WhiteBalance{}; }));
  script.limits.has_white_balance = false;
  EXPECT_TRUE(allowed([](auto& c) { c.white_balance = WhiteBalance{}; })) << "limits are those of the opened port";
}

TEST(SettingsChanges, AddAndRemove_ChangeTheFieldsOfTheOtherAndNoMore) {
  using Fill = void (*)(SettingsChange&);
  const std::array<Fill, 4> fields = {[](SettingsChange& c) { c.exposure = Exposure::microseconds(1); },
                                      [](SettingsChange& c) { c.gain = Gain::millidecibels(1); },
                                      [](SettingsChange& c) { c.white_balance = WhiteBalance{}; },
                                      [](SettingsChange& c) { c.gamma = hal::Gamma::thousandths(1); }};
  const auto has = [](const SettingsChange& c) {
    return std::array<bool, 4>{c.exposure.has_value(), c.gain.has_value(), c.white_balance.has_value(),
                               c.gamma.has_value()};
  };
  for (std::size_t k = 0; k < fields.size(); ++k) {
    SettingsChange all, one, none;
    for (const Fill fill : fields) fill(all);
    fields[k](one);
    none.add(one);
    std::array<bool, 4> only{};
    only[k] = true;
    EXPECT_EQ(has(none), only) << k;
    all.remove(one);
    std::array<bool, 4> others{true, true, true, true};
    others[k] = false;
    EXPECT_EQ(has(all), others) << k;
  }
}

TEST_F(HeadTrouble, TemporarySettings_EndWithTheHostThatMadeThemAlsoWhileTheHeadIsGone) {
  constexpr std::uint64_t kBorrower = 7, kOtherHost = 8;
  SettingsChange shorter;
  shorter.exposure = Exposure::microseconds(4000);
  const auto in_effect = [&](int us) {
    hal::FrameView view = frame();
    view.in_effect.exposure = Exposure::microseconds(us);
    script.frames.push_back(view);
    const auto taken = head.take_frame();
    ASSERT_TRUE(taken);
    head.lose(*taken, LossReason::kLate);
  };
  for (const bool gone : {false, true}) {
    SCOPED_TRACE(gone);
    stream();
    in_effect(8000);
    ASSERT_TRUE(head.change(shorter, kBorrower));
    EXPECT_TRUE(head.check_lease(kBorrower));
    EXPECT_EQ(head.check_lease(kOtherHost).error().code, Errc::kBusy);
    EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(4000));
    EXPECT_TRUE(head.end_lease(kOtherHost));
    EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(4000)) << "not its own";
    if (gone) {
      script.fail_at = script.calls;
      EXPECT_FALSE(head.take_frame());
      ASSERT_FALSE(head.report().present);
    }
    const int calls = script.calls;
    EXPECT_TRUE(head.end_lease(kBorrower));
    EXPECT_EQ(script.calls - calls, gone ? 0 : 1) << "the exposure is requested of a head that is there";
    stream();
    in_effect(4000);
    EXPECT_EQ(head.pending_exposure(), Exposure::microseconds(8000));
    EXPECT_TRUE(head.check_lease(kOtherHost));
  }
  ASSERT_TRUE(head.change(shorter));
  EXPECT_TRUE(head.check_lease(kOtherHost)) << "a lasting setting is nobody's";
}

TEST_F(HeadTrouble, HeldAndInSets_AreCountedUntilTheyAreReleased) {
  stream();
  script.frames = {frame(1), frame(2)};
  const auto first = head.take_frame(), second = head.take_frame();
  ASSERT_TRUE(first && second);
  head.hold(*first);
  head.hold(*second);
  EXPECT_EQ(head.report().counts.held, 2u);
  head.put_in_set(Duration::microseconds(7));
  head.put_in_set(Duration::microseconds(9));
  EXPECT_EQ(head.report().counts.in_sets, 2u);
  EXPECT_EQ(head.report().counts.held, 0u);
  EXPECT_EQ(head.report().skew, Duration::microseconds(9));
  EXPECT_TRUE(head.conserved());
  head.release(1);
  EXPECT_EQ(script.lent, (std::set<hal::BufferSlot>{2}));
  head.release(2);
  EXPECT_TRUE(script.lent.empty());
  EXPECT_TRUE(head.conserved());
  head.close();
}

}  // namespace
}  // namespace nodal::firmware
