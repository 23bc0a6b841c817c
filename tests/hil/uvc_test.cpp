// The V4L2 head on uvcvideo: what reaches the camera's registers, what its pictures show, and each of its faults.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "uvc_camera.h"
#include "vivid.h"

namespace nodal::hil {
namespace {

using hal::FrameVerdict;
using hal::FrameView;
using hal::HeadPort;
using hal::TriggerMode;

constexpr std::int32_t kGainStepMdb = 100;

Exposure in_100_us(std::uint32_t units) { return Exposure::microseconds(std::int64_t{units} * 100); }
Gain in_steps(std::uint32_t steps) { return Gain::millidecibels(static_cast<std::int32_t>(steps) * kGainStepMdb); }

class Uvc : public testing::Test {
 protected:
  std::unique_ptr<HeadPort> open() {
    hal::v4l2::HeadRequest request;
    request.pixels = PixelFormat::kYuyv;
    request.rate = {30, 1};
    request.width = UvcCamera::kWidth;
    request.height = UvcCamera::kHeight;
    request.gain_step_mdb = kGainStepMdb;
    enumerator_.request(UvcCamera::path(), request);
    auto head = enumerator_.open_and_wait(UvcCamera::path());
    if (!head) throw std::runtime_error(head.error().text());
    return std::move(*head);
  }
  std::unique_ptr<HeadPort> streaming() {
    auto head = open();
    if (const Status started = head->start(TriggerMode::kFreeRun); !started) {
      throw std::runtime_error(started.error().text());
    }
    return head;
  }
  Result<FrameView> next(HeadPort& head) { return next_frame(head, clock_); }
  /// Frames, each of which is released at once.
  std::vector<FrameView> frames(HeadPort& head, int count) {
    std::vector<FrameView> all;
    for (int i = 0; i < count; ++i) {
      const auto frame = next(head);
      if (!frame) throw std::runtime_error(frame.error().text());
      all.push_back(*frame);
      head.release(frame->slot);
    }
    return all;
  }

  UvcCamera camera_;
  hal::linux_os::LinuxClock clock_;
  hal::v4l2::V4l2Enumerator enumerator_{clock_};
};

TEST_F(Uvc, Opened_ItsAutomaticExposureIsOffAndItsLimitsAreTheCameras) {
  ASSERT_EQ(camera_.exposure_mode(), UvcCamera::kAutomatic);
  const auto head = open();
  EXPECT_EQ(camera_.exposure_mode(), UvcCamera::kManual);
  EXPECT_EQ(head->limits().exposure_min, in_100_us(1));
  EXPECT_EQ(head->limits().exposure_max, in_100_us(UvcCamera::kLongest));
  EXPECT_EQ(head->limits().gain_max, in_steps(UvcCamera::kMaxGain));
}

TEST_F(Uvc, RequestedExposureAndGain_AreInItsRegisters) {
  const auto head = streaming();
  for (const auto& [exposure, gain] : {std::pair{1U, 0U}, {UvcCamera::kLongest, 255U}, {123U, 77U}}) {
    ASSERT_TRUE(head->set_exposure(in_100_us(exposure)));
    ASSERT_TRUE(head->set_gain(in_steps(gain)));
    frames(*head, 5);
    EXPECT_EQ(camera_.exposure(), exposure);
    EXPECT_EQ(camera_.gain(), gain);
  }
  EXPECT_FALSE(head->set_exposure(in_100_us(UvcCamera::kLongest + 1)));
  EXPECT_EQ(camera_.exposure(), 123U);
}

// The head states what was in effect; the picture shows it. From a change on until it is stated, frames may differ.
TEST_F(Uvc, FramesThatStateTheNewExposure_WereTakenWithIt) {
  const auto head = streaming();
  int stated = 0;
  for (std::uint32_t exposure = 10; exposure < 250; exposure += 20) {
    ASSERT_TRUE(head->set_exposure(in_100_us(exposure)));
    int waited = 0;
    for (bool now = false; !now && waited < 30; ++waited) {
      const auto frame = next(*head);
      ASSERT_TRUE(frame) << frame.error().text();
      now = frame->in_effect.exposure == in_100_us(exposure);
      const auto* row = frame->image.planes[0].data + frame->image.planes[0].row_stride;  // below the number
      EXPECT_TRUE(!now || row[0] == exposure) << exposure << " stated, " << int{row[0]} << " in the picture";
      head->release(frame->slot);
      stated += now ? 1 : 0;
    }
    EXPECT_LE(waited, 6) << exposure;
  }
  EXPECT_EQ(stated, 12);
}

TEST_F(Uvc, ControlThatTakesTwoSeconds_DelaysNoFrameOfItOrOfAnotherHead) {
  const auto head = streaming();
  enumerator_.request(vivid_path(0), webcam(PixelFormat::kYuyv));
  auto other = enumerator_.open_and_wait(vivid_path(0));
  ASSERT_TRUE(other) << other.error().text();
  ASSERT_TRUE((*other)->start(TriggerMode::kFreeRun));
  for (HeadPort* each : {head.get(), other->get()}) {
    for (int i = 0; i < 5; ++i) {
      const auto frame = next(*each);
      ASSERT_TRUE(frame) << frame.error().text();
      each->release(frame->slot);
    }
  }
  camera_.answer_controls_after(Duration::seconds(2));
  const Instant begun = clock_.now();
  ASSERT_TRUE(head->set_exposure(in_100_us(200)));
  struct Watched {
    HeadPort* head;
    Instant last;
    Duration longest;
    int frames = 0;
  };
  std::array<Watched, 2> all{Watched{head.get(), begun, {}}, Watched{other->get(), begun, {}}};
  while (clock_.now() - begun < Duration::seconds(3)) {
    for (Watched& each : all) {
      const auto frame = each.head->take_frame();
      ASSERT_TRUE(frame) << frame.error().text();
      if (!*frame) continue;
      each.longest = std::max(each.longest, clock_.now() - each.last);
      each.last = clock_.now();
      ++each.frames;
      each.head->release((*frame)->slot);
    }
    ASSERT_TRUE(camera_.exposure() != 200U || clock_.now() - begun > Duration::milliseconds(1900));
    wait_for(Duration::milliseconds(1));
  }
  EXPECT_EQ(camera_.exposure(), 200U);
  for (const Watched& each : all) {
    EXPECT_NEAR(each.frames, 90, 3);
    EXPECT_LT(each.longest.ms(), 50) << "a period and a half";
  }
}

TEST_F(Uvc, RefusesAnExposure_TheFramesKeepTheOldOneAndGoOn) {
  const auto head = streaming();
  ASSERT_TRUE(head->set_exposure(in_100_us(50)));
  frames(*head, 6);
  camera_.refuse_controls(true);
  (void)head->set_exposure(in_100_us(60));
  for (int i = 0; i < 20; ++i) {
    const auto frame = next(*head);
    if (!frame) continue;  // the refusal, said once
    EXPECT_EQ(frame->in_effect.exposure, in_100_us(50));
    head->release(frame->slot);
  }
  EXPECT_EQ(camera_.exposure(), 50U);
  camera_.refuse_controls(false);
  ASSERT_TRUE(head->set_exposure(in_100_us(70)));
  frames(*head, 6);
  EXPECT_EQ(camera_.exposure(), 70U);
}

// uvcvideo does not deliver such a frame, and counts it.
TEST_F(Uvc, FrameThatEndsInItsMiddle_IsMissingAndTheSequenceSaysSo) {
  const auto head = streaming();
  const std::vector<FrameView> before = frames(*head, 5);
  camera_.tear_a_frame();
  const std::vector<FrameView> after = frames(*head, 20);
  EXPECT_TRUE(std::all_of(after.begin(), after.end(), [](const auto& f) { return f.verdict == FrameVerdict::kGood; }));
  EXPECT_EQ(after.back().sequence - before.back().sequence, 21U);
}

TEST_F(Uvc, Silent_TheHeadHasNoFrameAndNoErrorAndGoesOnLater) {
  const auto head = streaming();
  frames(*head, 5);
  camera_.send_no_frames(true);
  while (next(*head)) {}
  const auto none = head->take_frame();
  ASSERT_TRUE(none) << none.error().text();
  EXPECT_FALSE(*none);
  camera_.send_no_frames(false);
  EXPECT_TRUE(next(*head));
}

TEST_F(Uvc, UnpluggedWhileStreaming_TheHeadIsGoneAndSoIsItsDevice) {
  auto head = streaming();
  frames(*head, 5);
  camera_.unplug();
  auto frame = next(*head);
  while (frame) frame = next(*head);
  EXPECT_EQ(frame.error().code, Errc::kDeviceGone) << frame.error().text();
  EXPECT_EQ(head->take_frame().error().code, Errc::kDeviceGone);
  head.reset();
  EXPECT_FALSE(enumerator_.open_and_wait(UvcCamera::path()));
}

}  // namespace
}  // namespace nodal::hil
