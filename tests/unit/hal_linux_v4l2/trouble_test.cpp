// A V4L2 head on a driver that fails or returns wrong data.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <atomic>
#include <cerrno>
#include <latch>
#include <set>

#include "hal/linux/v4l2/head.h"
#include "head_fixture.h"

namespace nodal::hal::v4l2 {
namespace {

TEST_F(V4l2HeadTest, OneBufferOnly_IsRefusedByTheFirstFrame) {
  driver_.fewest_buffers = driver_.most_buffers = 1;
  const auto head = streaming();
  expect_error(status_of(next(*head)), Errc::kDeviceFailed, "grants 1 buffers");
}

TEST_F(V4l2HeadTest, StartingFails_TheNextFrameSaysWhyAndNothingIsLeft) {
  struct Case {
    unsigned long request;
    int error;
    Errc code;
    const char* says;
  };
  std::atomic<const Case*> broken{nullptr};
  const auto hook = before([&](unsigned long request) {
    const Case* const one = broken.load();
    return one != nullptr && request == one->request ? one->error : 0;
  });
  for (const Case& one : {Case{VIDIOC_REQBUFS, ENOMEM, Errc::kDeviceFailed, "memory"},
                          Case{VIDIOC_REQBUFS, EBUSY, Errc::kBusy, "another program"},
                          Case{VIDIOC_QUERYBUF, EINVAL, Errc::kDeviceFailed, "dmesg"},
                          Case{VIDIOC_QBUF, EIO, Errc::kDeviceFailed, "does not answer"},
                          Case{VIDIOC_STREAMON, ENOSPC, Errc::kBandwidth, "another port"},
                          Case{VIDIOC_STREAMON, ENODEV, Errc::kDeviceGone, "plug it in"}}) {
    {
      broken.store(&one);
      const auto head = streaming();
      expect_error(status_of(next(*head)), one.code, one.says);
      broken.store(nullptr);
    }
    expect_nothing_left();
    const auto again = streaming();
    EXPECT_TRUE(next(*again)) << "it opens and streams once the cause is gone";
  }
}

TEST_F(V4l2HeadTest, TheStreamBreaks_ItIsStartedAgainAndLentFramesStayWhatTheyWere) {
  std::atomic<int> broken{0};
  const auto hook = before([&](unsigned long request) {
    return request == VIDIOC_DQBUF && broken.load() > 0 && broken.fetch_sub(1) > 0 ? EIO : 0;
  });
  const auto head = streaming();
  const auto lent = next(*head);
  ASSERT_TRUE(lent);
  const std::uint8_t before = lent->image.planes[0].data[0];
  broken.store(2);
  std::set<BufferSlot> slots;
  for (int i = 0; i < 30; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
    EXPECT_NE(frame->slot, lent->slot);
    slots.insert(frame->slot);
    head->release(frame->slot);
  }
  EXPECT_EQ(head->recoveries().restarts, 2U);
  EXPECT_EQ(lent->image.planes[0].data[0], before);
  head->release(lent->slot);
  for (int i = 0; i < 8; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    slots.insert(frame->slot);
    head->release(frame->slot);
  }
  EXPECT_TRUE(slots.contains(lent->slot)) << "its buffer is used again";
}

TEST_F(V4l2HeadTest, AFrameIsReleasedWhileTheStreamIsBroken_ItsBufferIsUsedAgain) {
  std::atomic<bool> broken{false};
  const auto hook =
      before([&](unsigned long request) { return request == VIDIOC_DQBUF && broken.exchange(false) ? EIO : 0; });
  driver_.fewest_buffers = driver_.most_buffers = 2;
  const auto head = streaming();
  const auto first = next(*head);
  const auto second = next(*head);
  ASSERT_TRUE(first && second);
  broken.store(true);
  ASSERT_TRUE(head->take_frame());
  head->release(second->slot);
  const auto third = next(*head);
  ASSERT_TRUE(third) << third.error().message;
  EXPECT_EQ(third->slot, second->slot);
}

TEST_F(V4l2HeadTest, TheStreamBreaksEveryTime_ItFailsForGood) {
  std::atomic<bool> broken{true};
  const auto hook = before([&](unsigned long request) { return request == VIDIOC_DQBUF && broken.load() ? EIO : 0; });
  auto head = streaming();
  expect_error(status_of(next(*head)), Errc::kDeviceFailed, "5 times");
  EXPECT_EQ(head->recoveries().restarts, static_cast<std::uint64_t>(V4l2Head::kMaxRestarts));
  expect_error(head->start(TriggerMode::kFreeRun), Errc::kDeviceFailed, "5 times");
  broken.store(false);
  head.reset();
  EXPECT_TRUE(next(*streaming())) << "opened anew, it streams";
}

TEST_F(V4l2HeadTest, ABufferIsRefusedOnce_ItIsCountedAndTakenTheNextTime) {
  std::atomic<bool> refused{false};
  const auto hook =
      before([&](unsigned long request) { return request == VIDIOC_QBUF && refused.exchange(false) ? EINVAL : 0; });
  driver_.fewest_buffers = driver_.most_buffers = 2;
  const auto head = streaming();
  const auto first = next(*head);
  const auto second = next(*head);
  ASSERT_TRUE(first && second);
  refused.store(true);
  head->release(first->slot);
  EXPECT_EQ(head->recoveries().refused_buffers, 1U);
  const auto third = next(*head);
  ASSERT_TRUE(third);
  EXPECT_EQ(third->slot, first->slot);
  EXPECT_EQ(head->recoveries().restarts, 0U);
}

TEST_F(V4l2HeadTest, AnIndexThatCannotBe_IsABrokenStreamAndNoMemoryIsTouched) {
  std::atomic<std::int64_t> lie{-1};
  const auto hook = after([&](unsigned long request, void* argument) {
    if (request != VIDIOC_DQBUF) return;
    if (const std::int64_t index = lie.exchange(-1); index >= 0) {
      static_cast<v4l2_buffer*>(argument)->index = static_cast<std::uint32_t>(index);
    }
  });
  const auto head = streaming();
  const auto lent = next(*head);
  ASSERT_TRUE(lent);
  std::uint64_t restarts = 0;
  for (const std::int64_t index :
       {std::int64_t{lent->slot}, std::int64_t{4}, std::int64_t{32}, std::int64_t{0xFFFFFFFF}}) {
    lie.store(index);
    const auto frame = next(*head);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_NE(frame->slot, lent->slot) << "a lent buffer is not handed out again";
    EXPECT_EQ(head->recoveries().restarts, ++restarts);
    head->release(frame->slot);
  }
}

TEST_F(V4l2HeadTest, BytesThatCannotBe_AreAVerdictAndTheWholePictureStaysReadable) {
  constexpr std::uint32_t kTrue = 0xABCD;
  std::atomic<std::uint32_t> used{kTrue};
  std::atomic<std::uint32_t> flags{0};
  const auto hook = after([&](unsigned long request, void* argument) {
    if (request != VIDIOC_DQBUF) return;
    auto& buffer = *static_cast<v4l2_buffer*>(argument);
    if (used.load() != kTrue) buffer.bytesused = used.load();
    buffer.flags |= flags.load();
  });
  const auto head = streaming();
  struct Case {
    std::uint32_t used, flags;
    FrameVerdict verdict;
  };
  for (const Case& one :
       {Case{kTrue, 0, FrameVerdict::kGood}, Case{0, 0, FrameVerdict::kTorn}, Case{100, 0, FrameVerdict::kTorn},
        Case{0xFFFFFFFF, 0, FrameVerdict::kCorrupt}, Case{kTrue, V4L2_BUF_FLAG_ERROR, FrameVerdict::kCorrupt}}) {
    used.store(one.used);
    flags.store(one.flags);
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->verdict, one.verdict) << one.used;
    unsigned sum = 0;
    for (const PlaneView& plane : frame->image.planes) {  // the address sanitizer checks these accesses
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) sum += plane.data[y * plane.row_stride + x * plane.pixel_stride];
      }
    }
    EXPECT_GT(sum, 0U);
    head->release(frame->slot);
  }
}

TEST_F(V4l2HeadTest, BuffersSmallerThanAFrame_AreRefused) {
  const auto hook = after([](unsigned long request, void* argument) {
    if (request == VIDIOC_QUERYBUF) static_cast<v4l2_buffer*>(argument)->length = 1000;
  });
  const auto head = streaming();
  expect_error(status_of(next(*head)), Errc::kDeviceFailed, "1000 bytes");
}

TEST_F(V4l2HeadTest, TheInputHasNoPicture_FramesSaySoUntilItHasOne) {
  std::atomic<std::uint32_t> status{V4L2_IN_ST_NO_SIGNAL};
  const auto hook = after([&](unsigned long request, void* argument) {
    if (request == VIDIOC_ENUMINPUT) static_cast<v4l2_input*>(argument)->status = status.load();
  });
  const auto head = streaming();
  const auto verdict_after_a_second = [&] {
    FrameVerdict verdict = FrameVerdict::kGood;
    for (int i = 0; i < 30; ++i) {
      const auto frame = next(*head);
      if (!frame) throw std::runtime_error(frame.error().text());
      verdict = frame->verdict;
      head->release(frame->slot);
    }
    return verdict;
  };
  EXPECT_EQ(verdict_after_a_second(), FrameVerdict::kNoSignal);
  status.store(0);
  EXPECT_EQ(verdict_after_a_second(), FrameVerdict::kGood);
}

TEST_F(V4l2HeadTest, WhatTheDriverSaysOfItsColours_GoesWithEveryFrame) {
  struct Case {
    std::uint32_t colorspace, encoding, quantization;
    ColourCoding expected;
  };
  // "Default" as V4L2 defines it (Documentation/userspace-api/media/v4l/colorspaces-details.rst).
  for (const Case& one :
       {Case{V4L2_COLORSPACE_SMPTE170M, V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_FULL_RANGE, {false, false}},
        Case{V4L2_COLORSPACE_SMPTE170M, V4L2_YCBCR_ENC_DEFAULT, V4L2_QUANTIZATION_DEFAULT, {true, false}},
        Case{V4L2_COLORSPACE_REC709, V4L2_YCBCR_ENC_DEFAULT, V4L2_QUANTIZATION_DEFAULT, {true, true}},
        Case{V4L2_COLORSPACE_JPEG, V4L2_YCBCR_ENC_DEFAULT, V4L2_QUANTIZATION_DEFAULT, {false, false}},
        Case{V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_DEFAULT, V4L2_QUANTIZATION_DEFAULT, {true, false}},
        Case{V4L2_COLORSPACE_SRGB, V4L2_YCBCR_ENC_709, V4L2_QUANTIZATION_FULL_RANGE, {false, true}}}) {
    driver_.colorspace = one.colorspace;
    driver_.encoding = one.encoding;
    driver_.quantization = one.quantization;
    const auto head = streaming();
    const auto frame = next(*head);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->image.coding, one.expected) << one.colorspace << " " << one.encoding << " " << one.quantization;
    EXPECT_EQ(frame->image.planes[0].data[16], 16) << "the driver's own bytes, not converted";
    head->release(frame->slot);
  }
}

TEST_F(V4l2HeadTest, ColoursOfAnotherMatrix_AreRefusedWithTheDriversNumber) {
  driver_.encoding = V4L2_YCBCR_ENC_BT2020;
  const auto opened = open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, Errc::kUnsupported);
  EXPECT_NE(opened.error().message.find("neither BT.601 nor BT.709"), std::string::npos) << opened.error().message;
}

TEST_F(V4l2HeadTest, Jpegs_HaveTheLengthThatTheDriverSaysAndAnEmptyOneIsTorn) {
  driver_.formats = {V4L2_PIX_FMT_MJPEG};
  driver_.quantization = V4L2_QUANTIZATION_LIM_RANGE;  // says nothing about a JPEG
  request_.pixels = PixelFormat::kMjpeg;
  driver_.jpeg = std::vector<std::uint8_t>(333, 0x5A);
  const auto head = streaming();
  EXPECT_EQ(head->format().pixels, PixelFormat::kMjpeg);
  auto frame = next(*head);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->verdict, FrameVerdict::kGood);
  EXPECT_EQ(frame->image.format, PixelFormat::kMjpeg);
  EXPECT_EQ(frame->image.width, 48);
  EXPECT_EQ(frame->image.bytes, 333U);
  EXPECT_EQ(frame->image.planes[0].data[332], 0x5A);
  EXPECT_EQ(frame->image.coding, ColourCoding{});
  head->release(frame->slot);
  driver_.jpeg.clear();
  for (int i = 0; i < 8 && frame && frame->verdict == FrameVerdict::kGood; ++i) {
    frame = next(*head);
    if (frame) head->release(frame->slot);
  }
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->verdict, FrameVerdict::kTorn);
}

TEST_F(V4l2HeadTest, TheFirstAttemptIsUnderWay_OpeningSaysThatItIsNotReady) {
  std::latch answered(1);
  const auto hook = before([&](unsigned long request) {
    if (request == VIDIOC_QUERYCAP) answered.wait();
    return 0;
  });
  enumerator_ = std::make_unique<V4l2Enumerator>(clock_, driver_);
  enumerator_->request("v4l2:usb-1.2", request_);
  for (int i = 0; i < 3; ++i) {
    const auto early = enumerator_->open("v4l2:usb-1.2");
    ASSERT_FALSE(early);
    EXPECT_EQ(early.error().code, Errc::kNotReady);
  }
  answered.count_down();
  enumerator_->settle();
  EXPECT_TRUE(enumerator_->open("v4l2:usb-1.2"));
}

}  // namespace
}  // namespace nodal::hal::v4l2
