// Pictures that the rig encodes, decoded by FFmpeg from the file that a take would have.
#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "firmware/record/head_coder.h"
#include "protocol/take/matroska_writer.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::firmware {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kCodedWidth = 128, kCodedHeight = 96;

/// A smooth picture whose rows of one parity are dark and of the other bright, as two fields of a flash are.
Bytes flash(PixelFormat format) {
  Bytes bytes(packed_size(format, kCodedWidth, kCodedHeight), 128);
  const MutableImageView view = packed_image(format, kCodedWidth, kCodedHeight, bytes.data());
  const MutablePlaneView& luma = view.planes[0];
  for (int y = 0; y < kCodedHeight; ++y) {
    for (int x = 0; x < kCodedWidth; ++x) {
      luma.data[y * luma.row_stride + x * luma.pixel_stride] =
          static_cast<std::uint8_t>((y % 2 == 0 ? 30 : 170) + x / 4 + y / 8);
    }
  }
  return bytes;
}

HeadCoder coder_of(const take::Stream& delivered, TakeMode mode) {
  return HeadCoder(delivered, stored_stream(delivered, mode, PixelFormat::kI420));
}

struct Case {
  PixelFormat format;
  Fields fields;
};

class HeadCoderFiles : public testing::TestWithParam<Case> {};

TEST_P(HeadCoderFiles, FfmpegShowsTheRowsWhereTheyWere) {
  if (test::Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  const auto [format, fields] = GetParam();
  const Bytes bytes = flash(format);
  const ImageView picture = packed_image(format, kCodedWidth, kCodedHeight, bytes.data());
  HeadCoder coder = coder_of({format, kCodedWidth, kCodedHeight, {}, fields}, TakeMode::kJpeg);
  take::VideoTrack track;
  track.width = kCodedWidth;
  track.height = kCodedHeight;
  track.rate = FrameRate{30, 1};
  track.fields = fields;
  track.fields_apart = true;
  take::MatroskaWriter writer(track);
  Bytes file = writer.head();
  for (int k = 0; k < 3; ++k) {
    const auto parts = coder.code(picture, 95);
    ASSERT_TRUE(parts) << parts.error().text();
    EXPECT_EQ((*parts)[1].empty(), fields == Fields::kProgressive);
    Bytes packet((*parts)[0].begin(), (*parts)[0].end());
    packet.insert(packet.end(), (*parts)[1].begin(), (*parts)[1].end());
    const take::Block block{Duration::milliseconds(33) * k, packet};
    for (const auto& piece : writer.cluster(std::span(&block, 1)).pieces)
      file.insert(file.end(), piece.begin(), piece.end());
  }
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "film.mkv", file);
  const test::Finished decoded = test::Process({"ffmpeg", "-v", "error", "-i", (folder / "film.mkv").string(),
                                                "-pix_fmt", "gray", "-f", "rawvideo", (folder / "raw").string()})
                                     .wait();
  ASSERT_EQ(decoded.code, 0) << decoded.err;
  const Bytes raw = test::read_bytes(folder / "raw");
  constexpr std::size_t kFrame = std::size_t{kCodedWidth} * kCodedHeight;
  ASSERT_EQ(raw.size(), 3 * kFrame);
  const PlaneView& luma = picture.planes[0];
  for (std::size_t frame = 0; frame < 3; ++frame) {
    double worst = 0;
    for (int y = 0; y < kCodedHeight; ++y) {
      for (int x = 0; x < kCodedWidth; ++x) {
        const int was = luma.data[y * luma.row_stride + x * luma.pixel_stride];
        const int is = raw[frame * kFrame + static_cast<std::size_t>(y * kCodedWidth + x)];
        worst = std::max(worst, std::abs(static_cast<double>(is - was)));
      }
    }
    EXPECT_LE(worst, 12) << "frame " << frame << ": rows of the other field would be 140 off";
  }
}

INSTANTIATE_TEST_SUITE_P(
    Formats, HeadCoderFiles,
    testing::Values(Case{PixelFormat::kYuyv, Fields::kBottomFirst}, Case{PixelFormat::kYuyv, Fields::kTopFirst},
                    Case{PixelFormat::kUyvy, Fields::kBottomFirst}, Case{PixelFormat::kI420, Fields::kTopFirst},
                    Case{PixelFormat::kNv12, Fields::kBottomFirst}, Case{PixelFormat::kI422, Fields::kProgressive},
                    Case{PixelFormat::kGrey8, Fields::kProgressive}));

ImageView mjpeg(const Bytes& bytes) {
  ImageView view{PixelFormat::kMjpeg, kCodedWidth, kCodedHeight, {}, bytes.size(), {}};
  const int length = static_cast<int>(bytes.size());
  view.planes[0] = {bytes.data(), length, 1, length, 1};
  return view;
}

TEST(HeadCoder, RawOfMjpeg_IsThePictureThatFfmpegDecodes) {
  if (test::Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  const Bytes bytes = flash(PixelFormat::kI420);
  HeadCoder jpegs =
      coder_of({PixelFormat::kI420, kCodedWidth, kCodedHeight, {}, Fields::kProgressive}, TakeMode::kJpeg);
  const auto coded =
      (*jpegs.code(packed_image(PixelFormat::kI420, kCodedWidth, kCodedHeight, std::as_const(bytes).data()), 95))[0];
  const Bytes jpeg(coded.begin(), coded.end());
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "picture.jpg", jpeg);
  const test::Finished decoded = test::Process({"ffmpeg", "-v", "error", "-i", (folder / "picture.jpg").string(),
                                                "-pix_fmt", "yuvj420p", "-f", "rawvideo", (folder / "raw").string()})
                                     .wait();
  ASSERT_EQ(decoded.code, 0) << decoded.err;
  const Bytes expected = test::read_bytes(folder / "raw");

  const take::Stream delivered{PixelFormat::kMjpeg, kCodedWidth, kCodedHeight, {}, Fields::kProgressive};
  EXPECT_EQ(stored_stream(delivered, TakeMode::kRaw, PixelFormat::kI420).format, PixelFormat::kI420);
  EXPECT_EQ(stored_stream(delivered, TakeMode::kRaw, PixelFormat::kGrey16).format, PixelFormat::kGrey8);
  EXPECT_EQ(stored_stream(delivered, TakeMode::kJpeg, PixelFormat::kI420), delivered);
  EXPECT_EQ(stored_stream(delivered, TakeMode::kLossless, PixelFormat::kI420), delivered);
  HeadCoder coder = coder_of(delivered, TakeMode::kRaw);
  const auto parts = coder.code(mjpeg(jpeg), 0);
  ASSERT_TRUE(parts) << parts.error().text();
  ASSERT_EQ((*parts)[0].size(), expected.size());
  int worst = 0;
  for (std::size_t k = 0; k < expected.size(); ++k) worst = std::max(worst, std::abs((*parts)[0][k] - expected[k]));
  EXPECT_LE(worst, 2) << "two decoders round differently";
}

TEST(HeadCoder, AnMjpegThatLies_IsNotDecoded) {
  HeadCoder coder =
      coder_of({PixelFormat::kMjpeg, kCodedWidth, kCodedHeight, {}, Fields::kProgressive}, TakeMode::kRaw);
  const Bytes bytes = flash(PixelFormat::kGrey8);
  HeadCoder jpegs =
      coder_of({PixelFormat::kGrey8, kCodedWidth, kCodedHeight / 2, {}, Fields::kProgressive}, TakeMode::kJpeg);
  const auto coded =
      (*jpegs.code(packed_image(PixelFormat::kGrey8, kCodedWidth, kCodedHeight / 2, bytes.data()), 95))[0];
  Bytes jpeg(coded.begin(), coded.end());
  EXPECT_NE(coder.code(mjpeg(jpeg), 0).error().text().find("another size"), std::string::npos);
  jpeg.resize(jpeg.size() / 2);
  EXPECT_FALSE(coder.code(mjpeg(jpeg), 0));
  EXPECT_FALSE(coder.code(mjpeg({}), 0));
}

TEST(HeadCoder, ALowerQuality_GivesFewerBytes) {
  const Bytes bytes = flash(PixelFormat::kI420);
  const ImageView picture = packed_image(PixelFormat::kI420, kCodedWidth, kCodedHeight, bytes.data());
  HeadCoder coder =
      coder_of({PixelFormat::kI420, kCodedWidth, kCodedHeight, {}, Fields::kProgressive}, TakeMode::kJpeg);
  const std::size_t good = (*coder.code(picture, 90))[0].size();
  EXPECT_LT((*coder.code(picture, 45))[0].size(), good);
  EXPECT_EQ((*coder.code(picture, 90))[0].size(), good);
}

}  // namespace
}  // namespace nodal::firmware
