// The head's reaction to every fault that vivid can cause.
#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "vivid.h"

namespace nodal::hil {
namespace {

using hal::FrameVerdict;
using hal::FrameView;
using hal::HeadPort;
using hal::TriggerMode;

class Vivid : public testing::Test {
 protected:
  ~Vivid() override {
    enumerator_.reset();  // closes the device; a disconnected one returns when its last descriptor is closed
    for (const std::uint32_t control : {kWrapSequence, kPercentDropped}) set_vivid(0, control, 0);
  }

  std::unique_ptr<HeadPort> streaming(const hal::v4l2::HeadRequest& request = webcam(PixelFormat::kYuyv)) {
    enumerator_->request(vivid_path(0), request);
    auto head = enumerator_->open_and_wait(vivid_path(0));
    if (!head) throw std::runtime_error(head.error().text());
    if (const Status started = (*head)->start(TriggerMode::kFreeRun); !started) {
      throw std::runtime_error(started.error().text());
    }
    return std::move(*head);
  }
  Result<FrameView> next(HeadPort& head) { return next_frame(head, clock_); }
  /// The verdicts of frames, each of which is released at once.
  std::vector<FrameVerdict> verdicts(HeadPort& head, int frames) {
    std::vector<FrameVerdict> all;
    for (int i = 0; i < frames; ++i) {
      const auto frame = next(head);
      if (!frame) throw std::runtime_error(frame.error().text());
      all.push_back(frame->verdict);
      head.release(frame->slot);
    }
    return all;
  }
  static auto count(const std::vector<FrameVerdict>& all, FrameVerdict verdict) {
    return std::count(all.begin(), all.end(), verdict);
  }

  hal::linux_os::LinuxClock clock_;
  std::unique_ptr<hal::v4l2::V4l2Enumerator> enumerator_ = std::make_unique<hal::v4l2::V4l2Enumerator>(clock_);
};

TEST_F(Vivid, BufferErrorFlag_OneFrameIsCorrupt) {
  const auto head = streaming();
  ASSERT_EQ(count(verdicts(*head, 3), FrameVerdict::kGood), 3);
  set_vivid(0, kBufferErrorFlag, 1);
  const auto after = verdicts(*head, 20);
  EXPECT_EQ(count(after, FrameVerdict::kCorrupt), 1);
  EXPECT_EQ(count(after, FrameVerdict::kGood), 19);
}

TEST_F(Vivid, RequestingBuffersFails_TheFrameSaysSoAndOpeningAnewHelps) {
  enumerator_->request(vivid_path(0), webcam(PixelFormat::kYuyv));
  set_vivid(0, kReqbufsError, 1);
  {
    const auto head = streaming();
    const auto frame = next(*head);
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, Errc::kDeviceFailed);
    EXPECT_NE(frame.error().message.find("buffers"), std::string::npos) << frame.error().message;
  }
  EXPECT_TRUE(next(*streaming()));
}

TEST_F(Vivid, StreamonFails_TheFrameSaysSoAndOpeningAnewHelps) {
  set_vivid(0, kStreamonError, 1);
  {
    const auto head = streaming();
    const auto frame = next(*head);
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, Errc::kDeviceFailed);
    EXPECT_NE(frame.error().message.find("starting the stream"), std::string::npos) << frame.error().message;
  }
  EXPECT_TRUE(next(*streaming()));
}

TEST_F(Vivid, QueueingABufferFails_ItIsCountedAndEveryBufferIsUsedAgain) {
  const auto head = streaming();
  std::set<hal::BufferSlot> before;
  for (int i = 0; i < 40; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    before.insert(frame->slot);
    head->release(frame->slot);
  }
  set_vivid(0, kQbufError, 1);
  std::set<hal::BufferSlot> after;
  for (int i = 0; i < 40; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
    after.insert(frame->slot);
    head->release(frame->slot);
  }
  EXPECT_EQ(head->recoveries(), (hal::HeadRecoveries{0, 1}));
  EXPECT_EQ(after, before);
}

TEST_F(Vivid, FatalStreamingError_TheStreamIsStartedAgainAndALentFrameStays) {
  const auto head = streaming();
  const auto lent = next(*head);
  ASSERT_TRUE(lent);
  const std::uint8_t sample = lent->image.planes[0].data[1234];
  set_vivid(0, kFatalError, 1);
  EXPECT_EQ(count(verdicts(*head, 30), FrameVerdict::kGood), 30);
  EXPECT_EQ(head->recoveries(), (hal::HeadRecoveries{1, 0}));
  EXPECT_EQ(lent->image.planes[0].data[1234], sample);
  head->release(lent->slot);
  EXPECT_EQ(count(verdicts(*head, 10), FrameVerdict::kGood), 10);
}

TEST_F(Vivid, Disconnected_TheHeadIsGoneAndComesBackWhenItIsClosed) {
  {
    const auto head = streaming();
    ASSERT_TRUE(next(*head));
    set_vivid(0, kDisconnect, 1);
    Result<FrameView> frame = next(*head);
    for (int i = 0; i < 40 && frame; ++i) frame = next(*head);
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, Errc::kDeviceGone);
    const auto again = enumerator_->open_and_wait(vivid_path(0));
    ASSERT_FALSE(again);
    EXPECT_EQ(again.error().code, Errc::kNoSuchDevice);
  }
  enumerator_->settle();
  EXPECT_TRUE(next(*streaming()));
}

TEST_F(Vivid, BuffersAreDropped_TheSequenceTellsOfEveryOne) {
  const auto head = streaming();
  ASSERT_TRUE(next(*head));
  set_vivid(0, kPercentDropped, 50);
  const auto first = next(*head);
  ASSERT_TRUE(first);
  head->release(first->slot);
  std::uint32_t sequence = first->sequence;
  std::uint32_t missing = 0;
  Instant at = first->mid_exposure;
  const Duration period = head->format().rate.period();
  for (int i = 0; i < 60; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
    const std::uint32_t steps = frame->sequence - sequence;
    ASSERT_GE(steps, 1U);
    // The clock agrees with the sequence number: the same number of periods has passed.
    EXPECT_NEAR(static_cast<double>((frame->mid_exposure - at).ns()) / static_cast<double>(period.ns()), steps, 0.3);
    missing += steps - 1;
    sequence = frame->sequence;
    at = frame->mid_exposure;
    head->release(frame->slot);
  }
  // Half of the n frames are dropped: 60 lost for 60 received, +- four standard deviations of sqrt(120) / 2.
  EXPECT_NEAR(missing, 60, 4 * 11);
}

TEST_F(Vivid, SequenceNumbersWrap_FramesGoOn) {
  set_vivid(0, kWrapSequence, 1);  // numbering restarts 128 before the wrap
  const auto head = streaming();
  bool wrapped = false;
  std::uint32_t last = 0;
  for (int i = 0; i < 160; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
    if (i > 0) {
      EXPECT_EQ(frame->sequence, last + 1);
      wrapped |= frame->sequence < last;
    }
    last = frame->sequence;
    head->release(frame->slot);
  }
  EXPECT_TRUE(wrapped);
}

TEST_F(Vivid, NoSignalAndNoLock_FramesSaySoUntilThePictureIsBack) {
  const auto head = streaming(ntsc(PixelFormat::kYuyv));
  EXPECT_EQ(count(verdicts(*head, 30), FrameVerdict::kGood), 30);
  for (const int mode : {1, 2}) {
    set_vivid(0, kSignalMode, mode);
    EXPECT_EQ(verdicts(*head, 40).back(), FrameVerdict::kNoSignal) << mode;
    set_vivid(0, kSignalMode, 0);
    EXPECT_EQ(verdicts(*head, 40).back(), FrameVerdict::kGood) << mode;
  }
}

TEST_F(Vivid, StartOfExposureTimestamps_TheMiddleOfTheExposureIsTheSameWithinAPeriod) {
  const Duration period = webcam(PixelFormat::kYuyv).rate.period();
  for (const int source : {0, 1}) {
    set_vivid(0, kTimestampSource, source);
    const auto head = streaming();
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_LE(frame->mid_exposure, frame->received);
    EXPECT_LT(clock_.now() - frame->mid_exposure, period * 2) << source;
  }
  set_vivid(0, kTimestampSource, 0);
}

TEST_F(Vivid, GainWhileItStreams_NoFrameIsLostAndTheNewValueArrives) {
  const auto head = streaming();
  std::optional<std::uint32_t> last;
  for (int i = 0; i < 90; ++i) {
    if (i % 15 == 0) {
      ASSERT_TRUE(head->set_gain(Gain::millidecibels(1'000 + 100 * i)));
    }
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    if (last) {
      EXPECT_EQ(frame->sequence, *last + 1);
    }
    last = frame->sequence;
    if (i % 15 == 14) {
      EXPECT_EQ(frame->in_effect.gain, Gain::millidecibels(1'000 + 100 * (i - 14)));
    }
    head->release(frame->slot);
  }
}

TEST_F(Vivid, FormatsAndRatesThatItDoesNotHave_AreRefusedWithWhatItHas) {
  hal::v4l2::HeadRequest request = webcam(PixelFormat::kYuyv);
  request.width = 300;
  request.height = 200;
  enumerator_->request(vivid_path(0), request);
  const auto size = enumerator_->open_and_wait(vivid_path(0));
  ASSERT_FALSE(size);
  EXPECT_NE(size.error().message.find("640x480"), std::string::npos) << size.error().message;
  request = ntsc(PixelFormat::kYuyv);
  request.rate = {25, 1};
  enumerator_->request(vivid_path(0), request);
  (void)enumerator_->open_and_wait(vivid_path(0));
  enumerator_->settle();
  const auto rate = enumerator_->open_and_wait(vivid_path(0));
  ASSERT_FALSE(rate);
  EXPECT_NE(rate.error().message.find("30000/1001"), std::string::npos) << rate.error().message;
}

}  // namespace
}  // namespace nodal::hil
