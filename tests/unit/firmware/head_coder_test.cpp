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
  HeadCoder coder(HeadStream{format, kCodedWidth, kCodedHeight, {}, fields}, HeadCoder::Mode::kJpeg);
  take::VideoTrack track;
  track.width = kCodedWidth;
  track.height = kCodedHeight;
  track.rate = FrameRate{30, 1};
  track.fields = fields;
  take::MatroskaWriter writer(track);
  Bytes file = writer.head();
  for (int k = 0; k < 3; ++k) {
    const auto parts = coder.encode(picture, 95);
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

TEST(HeadCoder, ALowerQuality_GivesFewerBytes) {
  const Bytes bytes = flash(PixelFormat::kI420);
  const ImageView picture = packed_image(PixelFormat::kI420, kCodedWidth, kCodedHeight, bytes.data());
  HeadCoder coder(HeadStream{PixelFormat::kI420, kCodedWidth, kCodedHeight, {}, Fields::kProgressive},
                  HeadCoder::Mode::kJpeg);
  const std::size_t good = (*coder.encode(picture, 90))[0].size();
  EXPECT_LT((*coder.encode(picture, 45))[0].size(), good);
  EXPECT_EQ((*coder.encode(picture, 90))[0].size(), good);
}

}  // namespace
}  // namespace nodal::firmware
