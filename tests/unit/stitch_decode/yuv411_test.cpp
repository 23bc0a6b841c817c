// Packed 4:1:1 against its definition, sample by sample, and its chroma against FFmpeg's scaler.
#include "stitch/decode/yuv411.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <vector>

#include "stitch/decode/recode.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::decode {
namespace {

std::vector<std::uint8_t> noise(std::size_t bytes) {
  std::mt19937 random(7);
  std::vector<std::uint8_t> all(bytes);
  for (std::uint8_t& one : all) one = static_cast<std::uint8_t>(random());
  return all;
}

std::vector<std::uint8_t> unpacked(const std::vector<std::uint8_t>& packed, int width, int height,
                                   ColourCoding coding = {}) {
  std::vector<std::uint8_t> planar(packed_size(PixelFormat::kI422, width, height));
  ImageView from = packed_image(PixelFormat::kYuv411, width, height, packed.data());
  from.coding = coding;
  unpack_411(from, packed_image(PixelFormat::kI422, width, height, planar.data()));
  return planar;
}

TEST(Yuv411, EverySampleOfEveryWidth_IsWhereTheDefinitionPutsIt) {
  constexpr int kHeight = 3;
  for (const int width : {1, 2, 3, 4, 5, 6, 7, 8, 37, 64}) {
    const auto packed = noise(packed_size(PixelFormat::kYuv411, width, kHeight));
    const auto planar = unpacked(packed, width, kHeight);
    const ImageView picture = packed_image(PixelFormat::kI422, width, kHeight, planar.data());
    const int row_bytes = 6 * ((width + 3) / 4);
    for (int y = 0; y < kHeight; ++y) {
      // The bytes of a group of four pixels: U, Y0, Y1, V, Y2, Y3.
      const auto byte = [&](int group, int k) {
        return int{packed[static_cast<std::size_t>(y * row_bytes + 6 * group + k)]};
      };
      const auto sample = [&](std::size_t c, int x) {
        return int{picture.planes[c].data[y * picture.planes[c].row_stride + x]};
      };
      for (int x = 0; x < width; ++x)
        ASSERT_EQ(sample(0, x), byte(x / 4, x % 4 + (x % 4 < 2 ? 1 : 2))) << width << " " << x;
      for (int x = 0; x < (width + 1) / 2; ++x) {
        for (std::size_t c = 1; c < 3; ++c) {
          const int k = c == 1 ? 0 : 3;
          const int here = byte(x / 2, k);
          const bool last = 4 * (x / 2 + 1) >= width;
          const int next = x % 2 == 0 || last ? here : byte(x / 2 + 1, k);
          ASSERT_EQ(sample(c, x), (here + next + 1) / 2) << width << " " << x << " component " << c;
        }
      }
    }
  }
}

TEST(Yuv411, VideoRange_IsThatOfTheUnpackedPicture) {
  const auto packed = noise(packed_size(PixelFormat::kYuv411, 22, 4));
  const ColourCoding coding{.video_range = true, .bt709 = true};
  const auto plain = unpacked(packed, 22, 4);
  ImageView from = packed_image(PixelFormat::kI422, 22, 4, plain.data());
  from.coding = coding;
  std::vector<std::uint8_t> expected(plain.size());
  recode(from, packed_image(PixelFormat::kI422, 22, 4, expected.data()));
  EXPECT_EQ(unpacked(packed, 22, 4, coding), expected);
}

// FFmpeg's scaler does not read uyyvyy411, so the same samples are given to it as planes (yuv411p).
TEST(Yuv411, BesideFfmpegsScaler_LumaIsEqualAndChromaAsClose) {
  constexpr int kWidth = 160, kHeight = 48, kGroups = kWidth / 4;
  // Smooth chroma, so that how it is interpolated matters little, and where it is matters.
  std::vector<std::uint8_t> packed, luma, u, v;
  for (int y = 0; y < kHeight; ++y) {
    for (int g = 0; g < kGroups; ++g) {
      const auto y_at = [&](int k) { return static_cast<std::uint8_t>(31 * g + 17 * k + 5 * y); };
      const auto u_here = static_cast<std::uint8_t>(40 + 4 * g + y / 2);
      const auto v_here = static_cast<std::uint8_t>(220 - 3 * g - y);
      for (int k = 0; k < 4; ++k) luma.push_back(y_at(k));
      u.push_back(u_here);
      v.push_back(v_here);
      for (const std::uint8_t byte : {u_here, y_at(0), y_at(1), v_here, y_at(2), y_at(3)}) packed.push_back(byte);
    }
  }
  std::vector<std::uint8_t> planes = luma;
  planes.insert(planes.end(), u.begin(), u.end());
  planes.insert(planes.end(), v.begin(), v.end());
  const test::TemporaryFolder folder;
  test::write_bytes(folder / "in.raw", planes);
  const auto done = test::Process({"ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "yuv411p", "-s",
                                   "160x48", "-i", (folder / "in.raw").string(), "-vf",
                                   "scale=in_h_chr_pos=0:out_h_chr_pos=0:flags=bilinear+accurate_rnd", "-pix_fmt",
                                   "yuv422p", "-f", "rawvideo", (folder / "out.raw").string()})
                        .wait();
  if (done.code == 127) GTEST_SKIP() << "ffmpeg is not installed";
  ASSERT_EQ(done.code, 0) << done.err;
  const auto expected = test::read_bytes(folder / "out.raw");
  const auto got = unpacked(packed, kWidth, kHeight);
  ASSERT_EQ(expected.size(), got.size());
  int furthest_luma = 0, furthest_chroma = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    int& furthest = i < luma.size() ? furthest_luma : furthest_chroma;
    furthest = std::max(furthest, std::abs(got[i] - expected[i]));
  }
  EXPECT_EQ(furthest_luma, 0);
  EXPECT_LE(furthest_chroma, 1);  // the slope is 4 levels a sample: half a sample off is 2
}

}  // namespace
}  // namespace nodal::decode
