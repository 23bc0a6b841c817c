#include "firmware/frame_tap.h"

#include <gtest/gtest.h>

#include <vector>

namespace nodal::firmware {
namespace {

constexpr int kWidth = 7, kHeight = 5;

/// A picture in memory whose rows are padded, as drivers pad them; no two samples alike.
struct Padded {
  explicit Padded(PixelFormat format) {
    const ImageView packed = packed_image(format, kWidth, kHeight, static_cast<const std::uint8_t*>(nullptr));
    view = packed;
    memory.resize(3 * 64 * 64);
    for (std::size_t k = 0; k < memory.size(); ++k) memory[k] = static_cast<std::uint8_t>(k * 31 + k / 64);
    for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(format)); ++c) {
      view.planes[c].data = memory.data() + c * 64 * 64;
      view.planes[c].row_stride = 64;
    }
  }
  std::vector<std::uint8_t> memory;
  ImageView view;
};

TappedSet places_of(const std::vector<PixelFormat>& formats) {
  TappedSet places;
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    places.places[i] = {formats[i], kWidth, kHeight, bytes, {}};
    places.wanted |= head_bit(i);
    bytes += packed_size(formats[i], kWidth, kHeight);
  }
  places.bytes = std::make_shared<std::vector<std::uint8_t>>(bytes);
  return places;
}

TEST(FrameTap, PaddedPicturesOfEveryFormat_EverySampleIsInItsPlace) {
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kNv12,
                                         PixelFormat::kYuyv,  PixelFormat::kUyvy, PixelFormat::kRgb24};
  std::vector<Padded> pictures(formats.begin(), formats.end());
  FrameSet set;
  set.number = 41;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    set.frames[i].image = pictures[i].view;
    set.frames[i].in_effect.gain = Gain::millidecibels(static_cast<std::int32_t>(i));
    set.mask |= head_bit(i);
  }
  FrameTap tap;
  ASSERT_TRUE(tap.want(places_of(formats)));
  ASSERT_TRUE(tap.wanted());
  const Sha256 id{1, 2, 3};
  tap.fill(set, &id);
  EXPECT_FALSE(tap.wanted());
  const auto taken = tap.take();
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->set, 41u);
  EXPECT_EQ(taken->calibration, id);
  EXPECT_EQ(taken->heads, set.mask);
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const ImageView copy = packed_image(formats[i], kWidth, kHeight,
                                        static_cast<const std::uint8_t*>(taken->bytes->data() + taken->places[i].offset));
    EXPECT_EQ(taken->places[i].in_effect.gain.mdb(), static_cast<std::int32_t>(i));
    for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(formats[i])); ++c) {
      const PlaneView& a = pictures[i].view.planes[c];
      const PlaneView& b = copy.planes[c];
      for (int y = 0; y < a.height; ++y) {
        for (int x = 0; x < a.width; ++x) {
          ASSERT_EQ(a.data[y * a.row_stride + x * a.pixel_stride], b.data[y * b.row_stride + x * b.pixel_stride])
              << pixel_format_name(formats[i]) << " component " << c << " at " << x << ", " << y;
        }
      }
    }
  }
}

TEST(FrameTap, AHeadIsAwayOrDeliversSomethingElse_ItIsLeftOut) {
  Padded grey(PixelFormat::kGrey8), rgb(PixelFormat::kRgb24);
  FrameSet set;
  set.frames[1].image = grey.view;
  set.frames[2].image = rgb.view;
  set.mask = head_bit(1) | head_bit(2);
  FrameTap tap;
  ASSERT_TRUE(tap.want(places_of({PixelFormat::kGrey8, PixelFormat::kGrey8, PixelFormat::kGrey8})));
  tap.fill(set, nullptr);
  const auto taken = tap.take();
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->heads, head_bit(1));
  EXPECT_FALSE(taken->blended);
}

TEST(FrameTap, OneAtATimeAndAWishMayBeTakenBackUntilItIsFilled) {
  Padded grey(PixelFormat::kGrey8);
  FrameSet set;
  set.frames[0].image = grey.view;
  set.mask = head_bit(0);
  FrameTap tap;
  EXPECT_FALSE(tap.wanted());
  EXPECT_FALSE(tap.withdraw());
  ASSERT_TRUE(tap.want(places_of({PixelFormat::kGrey8})));
  EXPECT_FALSE(tap.want(places_of({PixelFormat::kGrey8})));
  EXPECT_TRUE(tap.withdraw());
  tap.fill(set, nullptr);  // too late: nobody wants it
  EXPECT_FALSE(tap.take());
  ASSERT_TRUE(tap.want(places_of({PixelFormat::kGrey8})));
  tap.fill(set, nullptr);
  EXPECT_FALSE(tap.withdraw());
  EXPECT_TRUE(tap.take());
  EXPECT_FALSE(tap.take());
}

}  // namespace
}  // namespace nodal::firmware
