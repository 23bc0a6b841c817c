// Ut Video, judged by FFmpeg's decoder.
#include "stitch/media/ut_video.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <utility>

#include "protocol/take/matroska_writer.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::media {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

enum class Content { kSmooth, kNoise, kFlat, kRare };

/// A picture whose samples are known, for every format.
Bytes picture_of(PixelFormat format, int width, int height, Content content) {
  Bytes bytes(packed_size(format, width, height));
  std::mt19937 random(5);
  int level = 90;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (content == Content::kFlat) bytes[i] = 17;
    if (content == Content::kNoise) bytes[i] = static_cast<std::uint8_t>(random());
    if (content == Content::kSmooth) {
      level += static_cast<int>(random() % 9) - 4;
      bytes[i] = static_cast<std::uint8_t>(level);
    }
    // Differences whose counts fall by half: the codes of the rarest would be longer than 14 bits.
    if (content == Content::kRare) {
      int k = 0;
      while (k < 40 && random() % 2 == 0) ++k;
      bytes[i] = static_cast<std::uint8_t>((i == 0 ? 0 : bytes[i - 1]) + k);
    }
  }
  return bytes;
}

/// As FFmpeg stores it: one component after the other, R G B pixel by pixel.
Bytes planes_of(const ImageView& picture) {
  Bytes planes;
  if (picture.format == PixelFormat::kRgb24)
    return Bytes(picture.planes[0].data, picture.planes[0].data + picture.bytes);
  for (const PlaneView& plane : picture.planes) {
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) planes.push_back(plane.data[y * plane.row_stride + x * plane.pixel_stride]);
    }
  }
  return planes;
}

struct Kind {
  PixelFormat format;
  const char* ffmpeg;  ///< the format to which it decodes such a film
};

class UtVideoKinds : public testing::TestWithParam<std::tuple<Kind, Content>> {};

TEST_P(UtVideoKinds, FfmpegAndWeDecodeToTheSameBytes) {
  const auto& [kind, content] = GetParam();
  constexpr int kUtWidth = 54, kUtHeight = 36;
  const Bytes picture = picture_of(kind.format, kUtWidth, kUtHeight, content);
  Bytes coded;
  UtVideoEncoder encoder;
  encoder.encode(packed_image(kind.format, kUtWidth, kUtHeight, picture.data()), coded);
  EXPECT_LE(coded.size(), ut_video_most_bytes(kind.format, kUtWidth, kUtHeight));
  Bytes back;
  const Status decoded = decode_ut_video(coded, kind.format, kUtWidth, kUtHeight, back);
  ASSERT_TRUE(decoded) << decoded.error().text();
  EXPECT_EQ(back, picture);
  if (test::Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "no ffmpeg";

  take::VideoTrack track;
  track.codec = kUtVideoCodec;
  track.codec_private = ut_video_private(kind.format, kUtWidth, kUtHeight, {}, Fields::kProgressive);
  track.width = kUtWidth;
  track.height = kUtHeight;
  take::MatroskaWriter video(track);
  Bytes film = video.head();
  const take::Block block{Duration(), coded};
  for (const auto& piece : video.cluster(std::span(&block, 1)).pieces)
    film.insert(film.end(), piece.begin(), piece.end());
  std::string folder = (fs::temp_directory_path() / "ut-video-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const fs::path file = fs::path(folder) / "film.mkv";
  const fs::path raw = fs::path(folder) / "film.raw";
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(film.data()), static_cast<std::streamsize>(film.size()));
  const test::Finished ended = test::Process({"ffmpeg", "-v", "error", "-i", file.string(), "-pix_fmt", kind.ffmpeg,
                                              "-f", "rawvideo", raw.string()})
                                   .wait();
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(test::read_bytes(raw), planes_of(packed_image(kind.format, kUtWidth, kUtHeight, picture.data())));
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, UtVideoKinds,
    testing::Combine(testing::Values(Kind{PixelFormat::kI420, "yuv420p"}, Kind{PixelFormat::kNv12, "yuv420p"},
                                     Kind{PixelFormat::kI422, "yuv422p"}, Kind{PixelFormat::kYuyv, "yuv422p"},
                                     Kind{PixelFormat::kUyvy, "yuv422p"}, Kind{PixelFormat::kRgb24, "rgb24"}),
                     testing::Values(Content::kSmooth, Content::kNoise, Content::kFlat, Content::kRare)));

TEST(UtVideo, OtherFormats_AreNotCoded) {
  EXPECT_FALSE(ut_video_codes(PixelFormat::kGrey8, 64, 64));
  EXPECT_FALSE(ut_video_codes(PixelFormat::kRggb8, 64, 64));
  EXPECT_FALSE(ut_video_codes(PixelFormat::kMjpeg, 64, 64));
  EXPECT_FALSE(ut_video_codes(PixelFormat::kI420, 64, 63));
  EXPECT_FALSE(ut_video_codes(PixelFormat::kYuyv, 63, 64));
  EXPECT_TRUE(ut_video_codes(PixelFormat::kYuyv, 64, 63));
  EXPECT_TRUE(ut_video_codes(PixelFormat::kRgb24, 63, 63));
}

TEST(UtVideo, DamagedFrames_AreErrorsOrOtherPictures) {
  constexpr int kSide = 16;
  const Bytes picture = picture_of(PixelFormat::kI420, kSide, kSide, Content::kSmooth);
  Bytes good;
  UtVideoEncoder().encode(packed_image(PixelFormat::kI420, kSide, kSide, picture.data()), good);
  Bytes into;
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_FALSE(decode_ut_video(std::span(good).first(size), PixelFormat::kI420, kSide, kSide, into)) << size;
  std::mt19937 random(1);
  int refused = 0;
  for (int k = 0; k < 5000; ++k) {
    Bytes bad = good;
    bad[random() % bad.size()] = static_cast<std::uint8_t>(random());
    const Status decoded = decode_ut_video(bad, PixelFormat::kI420, kSide, kSide, into);
    refused += decoded ? 0 : 1;
    if (!decoded) {
      EXPECT_FALSE(decoded.error().message.empty());
    }
  }
  EXPECT_GT(refused, 1000) << "a changed code is not complete any more";
}

}  // namespace
}  // namespace nodal::media
