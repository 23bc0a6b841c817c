// Layouts, ranges and timestamps: calculations on a driver's answers.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "hal/linux/v4l2/layout.h"
#include "hal/linux/v4l2/timestamps.h"

namespace nodal::hal::v4l2 {
namespace {

TEST(V4l2Layout, PaddedI420InOneBuffer_ChromaFollowsTheLumasRowsAtHalfTheirStride) {
  const std::vector<std::uint32_t> strides{64};
  const auto layout = make_layout({V4L2_PIX_FMT_YUV420, PixelFormat::kI420, 1}, 48, 32, strides);
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->components[1].offset, 64U * 32);
  EXPECT_EQ(layout->components[2].offset, 64U * 32 + 32U * 16);
  EXPECT_EQ(layout->components[2].row_stride, 32);
  // The last row of V ends after its samples, not after its padding.
  EXPECT_EQ(layout->needed[0], 64U * 32 + 32U * 16 + 32U * 15 + 24);
}

TEST(V4l2Layout, MultiPlanarNv12_ChromaIsInItsOwnBuffer) {
  const std::vector<std::uint32_t> strides{48, 50};
  const auto layout = make_layout({V4L2_PIX_FMT_NV12M, PixelFormat::kNv12, 2}, 48, 32, strides);
  ASSERT_TRUE(layout);
  std::vector<std::uint8_t> luma(layout->needed[0]);
  std::vector<std::uint8_t> chroma(layout->needed[1]);
  const std::vector<const std::uint8_t*> planes{luma.data(), chroma.data(), nullptr};
  const ImageView view = view_of(*layout, planes, 0);
  EXPECT_EQ(view.planes[0].data, luma.data());
  EXPECT_EQ(view.planes[1].data, chroma.data());
  EXPECT_EQ(view.planes[2].data, chroma.data() + 1);
  EXPECT_EQ(layout->needed[1], 50U * 15 + 48);
}

TEST(V4l2Layout, PlanarFourTwoTwo_ChromaHasAllRows) {
  const std::vector<std::uint32_t> strides{64};
  const auto layout = make_layout({V4L2_PIX_FMT_YUV422P, PixelFormat::kI422, 1}, 48, 32, strides);
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->components[1].height, 32);
  EXPECT_EQ(layout->components[2].offset, 64U * 32 + 32U * 32);
  EXPECT_EQ(layout->needed[0], 64U * 32 + 32U * 32 + 32U * 31 + 24);
}

TEST(V4l2Layout, Mjpeg_StridesSayNothingAndTheViewHasTheFramesLength) {
  const std::vector<std::uint32_t> strides{0xFFFFFFFFU};
  const auto layout = make_layout({V4L2_PIX_FMT_MJPEG, PixelFormat::kMjpeg, 1}, 1920, 1080, strides);
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->needed[0], 1U);
  const std::vector<std::uint8_t> bytes(1000);
  const std::vector<const std::uint8_t*> planes{bytes.data(), nullptr, nullptr};
  const ImageView view = view_of(*layout, planes, 777);
  EXPECT_EQ(view.format, PixelFormat::kMjpeg);
  EXPECT_EQ(view.width, 1920);
  EXPECT_EQ(view.bytes, 777U);
  EXPECT_EQ(view.planes[0].data, bytes.data());
  EXPECT_EQ(view.planes[0].width, 777);
}

TEST(V4l2Layout, StridesThatRowsDoNotFitIn_AreRefused) {
  for (const std::uint32_t stride : {0U, 1U, 94U, 0xFFFFFFFFU}) {
    const std::vector<std::uint32_t> strides{stride};
    EXPECT_FALSE(make_layout({V4L2_PIX_FMT_YUYV, PixelFormat::kYuyv, 1}, 48, 32, strides)) << stride;
  }
  for (const int side : {0, -1, 100'000}) {
    const std::vector<std::uint32_t> strides{200'000};
    EXPECT_FALSE(make_layout({V4L2_PIX_FMT_GREY, PixelFormat::kGrey8, 1}, side, 32, strides)) << side;
    EXPECT_FALSE(make_layout({V4L2_PIX_FMT_GREY, PixelFormat::kGrey8, 1}, 48, side, strides)) << side;
  }
}

class V4l2Times : public testing::Test {
 protected:
  const Instant now_ = Instant::from_ns(5'000'000'000);
  const Exposure exposure_ = Exposure::microseconds(8'000);
  const Duration readout_ = Duration::milliseconds(33);
};

TEST_F(V4l2Times, EndOfFrame_TheMiddleIsReadoutAndHalfAnExposureBefore) {
  const Instant end = now_ - Duration::milliseconds(2);
  const FrameTimes times = times_of(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, end, now_, exposure_, readout_);
  EXPECT_EQ(times.mid_exposure, end - Duration::milliseconds(37));
  EXPECT_EQ(times.received, end);
}

TEST_F(V4l2Times, StartOfExposure_TheMiddleIsHalfAnExposureAfter) {
  const Instant start = now_ - Duration::milliseconds(40);
  const FrameTimes times =
      times_of(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE, start, now_, exposure_, readout_);
  EXPECT_EQ(times.mid_exposure, start + Duration::milliseconds(4));
  EXPECT_EQ(times.received, now_);
}

TEST_F(V4l2Times, AnotherClockThanTheRigs_TheFrameEndedWhenItWasTaken) {
  for (const std::uint32_t flags : {V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN, V4L2_BUF_FLAG_TIMESTAMP_COPY}) {
    const FrameTimes times = times_of(flags, Instant::from_ns(77), now_, exposure_, readout_);
    EXPECT_EQ(times.mid_exposure, now_ - Duration::milliseconds(37));
    EXPECT_EQ(times.received, now_);
  }
}

TEST_F(V4l2Times, TimestampsInTheFuture_NothingIsLaterThanNow) {
  for (const std::uint32_t source : {V4L2_BUF_FLAG_TSTAMP_SRC_EOF, V4L2_BUF_FLAG_TSTAMP_SRC_SOE}) {
    const FrameTimes times =
        times_of(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | source, now_ + Duration::seconds(100), now_, exposure_, readout_);
    EXPECT_LE(times.mid_exposure, times.received);
    EXPECT_LE(times.received, now_);
  }
}

}  // namespace
}  // namespace nodal::hal::v4l2
