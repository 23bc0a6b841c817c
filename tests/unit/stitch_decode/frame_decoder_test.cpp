// One head's decoder: which frames it is for, and which it changes.
#include "stitch/decode/frame_decoder.h"

#include <gtest/gtest.h>

#include "tests/support/pictures.h"

namespace nodal::decode {
namespace {

TEST(FrameDecoder, TheBlendedFormat_IsWhatTheRaymapNeeds) {
  using F = PixelFormat;
  EXPECT_EQ(blended_format(F::kMjpeg, F::kI420), F::kI420);
  EXPECT_EQ(blended_format(F::kMjpeg, F::kNv12), F::kI420);
  EXPECT_EQ(blended_format(F::kMjpeg, F::kRgb48), F::kRgb24);
  EXPECT_EQ(blended_format(F::kGrbg8, F::kGrey16), F::kGrey8);
  EXPECT_EQ(blended_format(F::kI422, F::kI420), F::kI422);
  EXPECT_EQ(blended_format(F::kYuv411, F::kNv12), F::kI422);
  EXPECT_EQ(blended_format(F::kYuv411, F::kGrey8), std::nullopt);
  EXPECT_EQ(blended_format(F::kYuyv, F::kRgb24), std::nullopt);
  EXPECT_EQ(blended_format(F::kGrey8, F::kI420), std::nullopt);
}

TEST(FrameDecoder, FramesThatTheBlendReadsAsTheyAre_NeedNoDecoding) {
  FrameDecoder decoder(PixelFormat::kYuyv, PixelFormat::kYuyv, 16, 8);
  const std::vector<std::uint8_t> bytes(packed_size(PixelFormat::kYuyv, 16, 8), 128);
  ImageView frame = packed_image(PixelFormat::kYuyv, 16, 8, bytes.data());
  EXPECT_TRUE(decoder.takes(frame));
  EXPECT_FALSE(decoder.needed(frame));
  frame.coding.video_range = true;
  EXPECT_TRUE(decoder.needed(frame));
  ImageView picture;
  EXPECT_EQ(decoder.decode(frame, picture), DecodeFault::kNone);
  EXPECT_EQ(picture.planes[0].data[0], 130);  // (128 - 16) * 255 / 219
  EXPECT_EQ(picture.coding, ColourCoding{});
  frame.width = 15;
  EXPECT_FALSE(decoder.takes(frame));
}

TEST(FrameDecoder, AJpegThatIsBroken_LeavesNoPicture) {
  FrameDecoder decoder(PixelFormat::kMjpeg, PixelFormat::kI420, 64, 48);
  const auto jpeg = test::jpeg_of(test::smooth_rgb(64, 48), 64, 48, test::Sampling::k422);
  ImageView frame{PixelFormat::kMjpeg, 64, 48, {}, jpeg.size()};
  frame.planes[0].data = jpeg.data();
  ImageView picture;
  EXPECT_EQ(decoder.decode(frame, picture), DecodeFault::kNone);
  EXPECT_EQ(picture.format, PixelFormat::kI420);
  EXPECT_NE(picture.planes[0].data, nullptr);
  frame.bytes = jpeg.size() / 2;
  EXPECT_EQ(decoder.decode(frame, picture), DecodeFault::kBroken);
  EXPECT_EQ(picture.planes[0].data, nullptr);
}

}  // namespace
}  // namespace nodal::decode
