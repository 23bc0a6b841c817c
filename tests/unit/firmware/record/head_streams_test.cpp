#include "firmware/record/head_streams.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

namespace nodal::firmware {
namespace {

/// Two heads that deliver grey pictures of 8 x 4 px, stored as they are delivered.
class HeadStreamsTest : public testing::Test {
 protected:
  static RigConfig two_heads() {
    RigConfig config;
    config.heads.resize(2);
    return config;
  }
  HeadStreamsTest() { std::iota(pixels_.begin(), pixels_.end(), std::uint8_t{1}); }
  hal::FrameView frame(int width = 8) {
    hal::FrameView view;
    view.image = packed_image(PixelFormat::kGrey8, width, 4, std::as_const(pixels_).data());
    return view;
  }
  FrameSet set(Duration time, const hal::FrameView& first) {
    FrameSet set;
    set.mid_exposure = Instant() + time;
    set.mask = head_bit(0);
    set.frames[0] = first;
    return set;
  }

  std::array<std::uint8_t, 64> pixels_{};
  HeadStreams streams_{two_heads()};
  PictureRing ring_{40};
  RecordedFrame stored_;
};

TEST_F(HeadStreamsTest, TheFirstPictureOfAHead_IsItsStream) {
  EXPECT_TRUE(streams_.follow(set({}, frame())));
  EXPECT_FALSE(streams_.follow(set(Duration::milliseconds(40), frame())));
  ASSERT_TRUE(streams_.in_take()[0]);
  EXPECT_EQ(streams_.in_take()[0]->width, 8);
  EXPECT_FALSE(streams_.in_take()[1]) << "it delivered nothing";
}

TEST_F(HeadStreamsTest, AnotherFormat_IsAPlaceholderForASecondAndThenTheStream) {
  streams_.follow(set({}, frame()));
  EXPECT_FALSE(streams_.follow(set(Duration::milliseconds(999), frame(4))));
  ASSERT_TRUE(streams_.store(frame(4), 0, 0, ring_, stored_));
  EXPECT_EQ(stored_.placeholder, Placeholder::kFormat);
  EXPECT_TRUE(stored_.bytes.empty());
  EXPECT_TRUE(streams_.follow(set(Duration::seconds(1), frame(4))));
  EXPECT_EQ(streams_.in_take()[0]->width, 4);
  ASSERT_TRUE(streams_.store(frame(4), 0, 0, ring_, stored_));
  EXPECT_EQ(stored_.placeholder, Placeholder::kNone);
}

TEST_F(HeadStreamsTest, AStoredPicture_HasTheBytesThatWereDelivered) {
  streams_.follow(set({}, frame()));
  EXPECT_EQ(streams_.most_bytes(frame(), 0), 32u);
  ASSERT_TRUE(streams_.store(frame(), 0, 0, ring_, stored_));
  EXPECT_TRUE(std::ranges::equal(stored_.bytes, std::span(pixels_).first(32)));
  EXPECT_EQ(stored_.quality, 0);
  EXPECT_EQ(ring_.used(), 32u);
}

TEST_F(HeadStreamsTest, WithoutRoomInTheRing_NothingIsStored) {
  streams_.follow(set({}, frame()));
  ASSERT_TRUE(streams_.store(frame(), 0, 0, ring_, stored_));
  EXPECT_FALSE(streams_.store(frame(), 0, 0, ring_, stored_));
}

TEST_F(HeadStreamsTest, ANewTake_BeginsWithoutStreams) {
  streams_.follow(set({}, frame()));
  streams_.begin();
  EXPECT_FALSE(streams_.in_take()[0]);
  EXPECT_TRUE(streams_.follow(set(Duration::milliseconds(1), frame(4)))) << "at once";
}

}  // namespace
}  // namespace nodal::firmware
