#include "firmware/hosts/set_copy.h"

#include <gtest/gtest.h>

#include <vector>

namespace nodal::firmware {
namespace {

constexpr int kCopiedWidth = 7, kCopiedHeight = 5;

/// A picture in memory with padded rows, as from drivers; all samples differ.
struct Padded {
  explicit Padded(PixelFormat format) {
    const ImageView packed =
        packed_image(format, kCopiedWidth, kCopiedHeight, static_cast<const std::uint8_t*>(nullptr));
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

SetCopy places_of(const std::vector<PixelFormat>& formats) {
  HeadShapes heads;
  for (const PixelFormat format : formats) heads.push_back(HeadShape{format, kCopiedWidth, kCopiedHeight});
  return SetCopy::places_for(heads, std::make_shared<std::vector<std::uint8_t>>());
}

TEST(SetCopy, PaddedPicturesOfEveryFormat_EverySampleIsInItsPlace) {
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8, PixelFormat::kI420,  PixelFormat::kNv12,
                                         PixelFormat::kYuyv,  PixelFormat::kUyvy,  PixelFormat::kRgb24,
                                         PixelFormat::kI422,  PixelFormat::kBggr8, PixelFormat::kYuv411};
  std::vector<Padded> pictures(formats.begin(), formats.end());
  FrameSet set;
  set.number = 41;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    set.frames[i].image = pictures[i].view;
    set.frames[i].in_effect.gain = Gain::millidecibels(static_cast<std::int32_t>(i));
    set.mask |= head_bit(i);
  }
  SetCopy taken = places_of(formats);
  taken.fill(set);
  EXPECT_EQ(taken.set, 41u);
  EXPECT_EQ(taken.heads, set.mask);
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const ImageView copy = packed_image(formats[i], kCopiedWidth, kCopiedHeight,
                                        static_cast<const std::uint8_t*>(taken.bytes->data() + taken.places[i].offset));
    EXPECT_EQ(taken.places[i].in_effect.gain.mdb(), static_cast<std::int32_t>(i));
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

TEST(SetCopy, AHeadIsAwayOrDeliversSomethingElse_ItIsLeftOut) {
  Padded grey(PixelFormat::kGrey8), rgb(PixelFormat::kRgb24);
  FrameSet set;
  set.frames[1].image = grey.view;
  set.frames[2].image = rgb.view;
  set.mask = head_bit(1) | head_bit(2);
  SetCopy taken = places_of({PixelFormat::kGrey8, PixelFormat::kGrey8, PixelFormat::kGrey8});
  taken.fill(set);
  EXPECT_EQ(taken.heads, head_bit(1));
  EXPECT_EQ(taken.places[1].offset, 0u) << "no gap is left for the head before it";
  EXPECT_EQ(taken.bytes->size(), packed_size(PixelFormat::kGrey8, kCopiedWidth, kCopiedHeight));
}

TEST(SetCopy, TheMemoryIsUsedAgainAfterASetThatLackedAHead_AllHeadsFitAgain) {
  Padded grey(PixelFormat::kGrey8), rgb(PixelFormat::kRgb24);
  FrameSet set;
  set.frames[0].image = grey.view;
  set.frames[1].image = rgb.view;
  set.mask = head_bit(1);
  const auto memory = std::make_shared<std::vector<std::uint8_t>>();
  const HeadShapes heads{HeadShape{PixelFormat::kGrey8, kCopiedWidth, kCopiedHeight},
                         HeadShape{PixelFormat::kRgb24, kCopiedWidth, kCopiedHeight}};
  SetCopy::places_for(heads, memory).fill(set);
  const std::size_t without = memory->size();
  set.mask |= head_bit(0);
  SetCopy all = SetCopy::places_for(heads, memory);
  all.fill(set);
  EXPECT_EQ(all.heads, set.mask);
  EXPECT_EQ(memory->size(), without + packed_size(PixelFormat::kGrey8, kCopiedWidth, kCopiedHeight));
}

TEST(SetCopy, Jpegs_AreCopiedWholeWithTheirLengthUnlessTheyAreLargerThanThePicture) {
  const std::size_t room = packed_size(PixelFormat::kI420, kCopiedWidth, kCopiedHeight);
  for (const std::size_t length : {std::size_t{1}, room, room + 1}) {
    std::vector<std::uint8_t> jpeg(length, 9);
    FrameSet set;
    ImageView& image = set.frames[1].image;
    image = {PixelFormat::kMjpeg, kCopiedWidth, kCopiedHeight, {}, length};
    image.planes[0].data = jpeg.data();
    set.mask = head_bit(1);
    SetCopy taken = places_of({PixelFormat::kGrey8, PixelFormat::kMjpeg});
    taken.fill(set);
    EXPECT_EQ(taken.heads, length > room ? 0 : head_bit(1));
    if (length > room) continue;
    EXPECT_EQ(taken.places[1].bytes, length);
    EXPECT_EQ(taken.bytes->size(), length) << "not the room of the largest JPEG";
    const auto begin = taken.bytes->begin() + static_cast<std::ptrdiff_t>(taken.places[1].offset);
    EXPECT_EQ(std::vector<std::uint8_t>(begin, begin + static_cast<std::ptrdiff_t>(length)), jpeg);
  }
}

}  // namespace
}  // namespace nodal::firmware
