// The IIDC head on libdc1394 and libusb: what reaches the camera's registers, what its pictures show, and each of its
// faults.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "iidc_camera.h"
#include "tests/support/process.h"
#include "vivid.h"

struct libusb_transfer;

namespace {

/// How long the kernel keeps a cancelled transfer.
std::atomic<std::chrono::milliseconds> g_kept_after_cancel{};

}  // namespace

/// Used instead of libusb's.
extern "C" int libusb_cancel_transfer(libusb_transfer* transfer) {
  using Function = int(libusb_transfer*);
  static auto* const real = reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, "libusb_cancel_transfer"));
  const std::chrono::milliseconds kept = g_kept_after_cancel;
  if (kept.count() == 0) return real(transfer);
  std::thread([transfer, kept] {
    std::this_thread::sleep_for(kept);
    real(transfer);
  }).detach();
  return 0;
}

namespace nodal::hil {
namespace {

using hal::FrameVerdict;
using hal::FrameView;
using hal::HeadPort;
using hal::TriggerMode;

class Iidc : public testing::Test {
 protected:
  std::unique_ptr<HeadPort> streaming(const hal::iidc::HeadRequest& request = IidcCamera::request(),
                                      TriggerMode mode = TriggerMode::kFreeRun) {
    enumerator_.request(IidcCamera::kPath, request);
    auto head = enumerator_.open_and_wait(IidcCamera::kPath);
    if (!head) throw std::runtime_error(head.error().text());
    if (const Status started = (*head)->start(mode); !started) throw std::runtime_error(started.error().text());
    return std::move(*head);
  }
  /// The next frame, returned at once.
  FrameView pass_frame(HeadPort& head) {
    const auto frame = next_frame(head, clock_);
    if (!frame) throw std::runtime_error(frame.error().text());
    pixel_ = frame->image.planes[0].data[frame->image.planes[0].row_stride];  // below the embedded numbers
    head.release(frame->slot);
    return *frame;
  }

  IidcCamera camera_;
  hal::linux_os::LinuxClock clock_;
  hal::iidc::IidcEnumerator enumerator_{clock_};
  std::uint8_t pixel_ = 0;  ///< a pixel of the newest frame
};

TEST_F(Iidc, Streaming_FramesArriveInOrderByTheCamerasCounterAtItsRate) {
  const auto head = streaming();
  EXPECT_EQ(head->identity().model, "Nodal emulator");
  EXPECT_EQ(head->identity().serial, "00b09d0100c0ffee");
  const FrameView first = pass_frame(*head);
  FrameView last = first;
  for (int i = 0; i < 60; ++i) {
    const FrameView frame = pass_frame(*head);
    EXPECT_EQ(frame.sequence, last.sequence + 1);
    EXPECT_EQ(frame.verdict, FrameVerdict::kGood);
    last = frame;
  }
  EXPECT_NEAR(static_cast<double>((last.mid_exposure - first.mid_exposure).us()), 2e6, 3e3);
}

TEST_F(Iidc, RequestedExposureAndGain_AreInItsRegistersAndInThePictureThatStatesThem) {
  const auto head = streaming();
  for (const auto& [us, mdb] : {std::pair{100, 0}, {30'100, 24'000}, {12'340, 7'250}}) {
    ASSERT_TRUE(head->set_exposure(Exposure::microseconds(us)));
    ASSERT_TRUE(head->set_gain(Gain::millidecibels(mdb)));
    int waited = 0;
    for (bool both = false; !both && waited < 10; ++waited) {
      const FrameView frame = pass_frame(*head);
      both = frame.in_effect.exposure == Exposure::microseconds(us) && frame.in_effect.gain == Gain::millidecibels(mdb);
    }
    EXPECT_LE(waited, 6) << us;
    EXPECT_EQ(pixel_, static_cast<std::uint8_t>(us / 10));
    EXPECT_NEAR(camera_.shutter(), us / 1e6, 1e-7);
    EXPECT_NEAR(camera_.gain(), mdb / 1e3, 1e-5);
  }
}

TEST_F(Iidc, RefusesAnExposure_FramesKeepTheOldOneAndGoOn) {
  const auto head = streaming();
  const Exposure before = pass_frame(*head).in_effect.exposure;
  camera_.refuse_writes(true);
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(5'000)));
  for (int i = 0; i < 10; ++i) EXPECT_EQ(pass_frame(*head).in_effect.exposure, before);
  camera_.refuse_writes(false);
}

TEST_F(Iidc, AControlThatTakesASecond_DelaysNoFrame) {
  const auto head = streaming();
  pass_frame(*head);
  camera_.answer_writes_after(Duration::seconds(1));
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(5'000)));
  Instant last = clock_.now();
  for (int i = 0; i < 25; ++i) {
    pass_frame(*head);
    EXPECT_LT((clock_.now() - last).ms(), 50);
    last = clock_.now();
  }
  camera_.answer_writes_after(Duration());
}

TEST_F(Iidc, ALostFrameAndATornOne_AreAGapAndAVerdictAndTheNextIsWhole) {
  const auto head = streaming();
  const std::uint32_t before = pass_frame(*head).sequence;
  camera_.skip_a_frame();
  EXPECT_EQ(pass_frame(*head).sequence, before + 2);
  camera_.tear_a_frame();
  EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kTorn);
  const FrameView whole = pass_frame(*head);
  EXPECT_EQ(whole.verdict, FrameVerdict::kGood);
  EXPECT_EQ(whole.sequence, before + 4);
  EXPECT_EQ(head->recoveries(), hal::HeadRecoveries{});
}

TEST_F(Iidc, Triggered_OneFrameAPulseAndNoneWithout) {
  hal::iidc::HeadRequest request = IidcCamera::request();
  request.triggered = true;
  request.trigger.active_high = false;
  const auto head = streaming(request, TriggerMode::kExternal);
  ASSERT_TRUE(test::wait_until([&] { return camera_.transmits(); }));
  EXPECT_EQ(camera_.trigger() & 0x03FF'0000, 0x0200'0000U) << "on, active low, mode 0";
  EXPECT_EQ(next_frame(*head, clock_).error().code, Errc::kTimeout);
  for (int i = 0; i < 5; ++i) {
    camera_.pulse();
    pass_frame(*head);
    wait_for(Duration::milliseconds(50));
    EXPECT_FALSE(*head->take_frame());
  }
}

TEST_F(Iidc, Stopped_NothingIsSentAndTheNextStreamBeginsWithAWholeFrame) {
  const auto head = streaming();
  for (int i = 0; i < 10; ++i) {
    for (int k = 0; k < i; ++k) EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kGood) << i;
    head->stop();
    enumerator_.settle();
    EXPECT_FALSE(camera_.transmits());
    ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  }
  EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kGood);
}

TEST_F(Iidc, TheKernelKeepsCancelledTransfers_TheStopWaitsForThemAndTheNextStreamIsWhole) {
  const auto head = streaming();
  pass_frame(*head);
  g_kept_after_cancel = std::chrono::milliseconds(3000);
  const Instant before = clock_.now();
  head->stop();
  EXPECT_LT((clock_.now() - before).ms(), 10) << "the worker waits, not capture's thread";
  enumerator_.settle();
  EXPECT_GE((clock_.now() - before).ms(), 3000);
  g_kept_after_cancel = std::chrono::milliseconds(0);
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  for (int i = 0; i < 10; ++i) EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kGood);
}

TEST_F(Iidc, UnpluggedWhileStreaming_TheErrorNamesTheHeadAndSoDoesOpeningIt) {
  auto head = streaming();
  pass_frame(*head);
  camera_.unplug();
  auto frame = next_frame(*head, clock_);
  while (frame) {
    head->release(frame->slot);
    frame = next_frame(*head, clock_);
  }
  EXPECT_EQ(frame.error().code, Errc::kDeviceGone) << frame.error().text();
  EXPECT_NE(frame.error().message.find(IidcCamera::kPath), std::string::npos) << frame.error().text();
  head.reset();
  const auto again = enumerator_.open_and_wait(IidcCamera::kPath);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, Errc::kNoSuchDevice) << again.error().text();
}

TEST_F(Iidc, Scanned_ItIsListedAlsoWhileItStreams) {
  const auto head = streaming();
  pass_frame(*head);
  const test::Finished scan = test::Process({NODAL_BIN_DIR "/nodald", "--scan"}).wait();
  EXPECT_EQ(scan.code, 0) << scan.err;
  EXPECT_NE(scan.out.find("# iidc:00b09d0100c0ffee: IIDC camera"), std::string::npos) << scan.out;
  EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kGood);
}

}  // namespace
}  // namespace nodal::hil
