#include "stitch/blend/prepare.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "small_tables.h"
#include "stitch/blend/low_picture.h"

namespace nodal::blend::test {
namespace {

constexpr std::array kFormats{PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kNv12,
                              PixelFormat::kYuyv,  PixelFormat::kUyvy, PixelFormat::kRgb24};

struct Prepared {
  std::vector<std::uint8_t> memory;
  std::array<ImageView, kMaxPictures> views;
  Prepared(const BlendTable::Source& source, const Picture& picture) : memory(prepared_size(source)) {
    prepare_picture(source, picture.view(), memory.data(), views);
  }
};

std::vector<std::uint8_t> bytes_of(const PlaneView& plane) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < plane.height; ++y) {
    for (int x = 0; x < plane.width; ++x) bytes.push_back(plane.data[y * plane.row_stride + x * plane.pixel_stride]);
  }
  return bytes;
}

TEST(PreparePicture, OneBrightSample_StandsOutMoreAndItsNeighboursLess) {
  Picture picture(PixelFormat::kGrey8, 5, 4, 100);
  picture.bytes[7] = 140;  // at (2, 1)
  BlendTable::Source source{PixelFormat::kGrey8, 5, 4};
  source.sharpen = 4;  // itself 140 + 4 * 160 / 64; two samples away 100 - 4 * 40 / 64 = 97.5, rounded up
  EXPECT_EQ(bytes_of(Prepared(source, picture).views[0].planes[0]),
            (std::vector<std::uint8_t>{100, 100, 100, 100, 100, 98,  100, 150, 100, 98,  //
                                       100, 100, 100, 100, 100, 100, 100, 98,  100, 100}));
  picture.bytes[7] = 255;
  source.sharpen = 16;
  EXPECT_EQ(bytes_of(Prepared(source, picture).views[0].planes[0])[7], 255);  // 255 + 155 exceeds white
  EXPECT_EQ(bytes_of(Prepared(source, picture).views[0].planes[0])[5], 61);   // 100 - 155 / 4 = 61.25
}

TEST(PreparePicture, NothingToDo_TakesNoMemoryAndIsThePictureItself) {
  const Picture picture(PixelFormat::kUyvy, 6, 4, 9);
  const Prepared prepared({PixelFormat::kUyvy, 6, 4}, picture);
  EXPECT_TRUE(prepared.memory.empty());
  EXPECT_EQ(prepared.views[0].planes[1].data, picture.view().planes[1].data);
}

TEST(PreparePicture, Levels_AreMeansOfFourEachOfTheOneBefore) {
  Picture picture(PixelFormat::kGrey8, 5, 4);
  picture.bytes = {1, 3, 10,  10,  99,  //
                   5, 8, 10,  12,  99,  //
                   0, 0, 255, 255, 99, 0, 1, 255, 255, 99};
  BlendTable::Source source{PixelFormat::kGrey8, 5, 4};
  source.levels = 3;
  const Prepared prepared(source, picture);
  EXPECT_EQ(bytes_of(prepared.views[1].planes[0]), (std::vector<std::uint8_t>{4, 11, 0, 255}));  // 4.25, 10.5, 0.25
  EXPECT_EQ(bytes_of(prepared.views[2].planes[0]), std::vector<std::uint8_t>{68});               // 67.5
  source.sharpen = 8;                                                                            // affects only level 0
  EXPECT_EQ(bytes_of(Prepared(source, picture).views[1].planes[0]), (std::vector<std::uint8_t>{4, 11, 0, 255}));
}

TEST(PreparePicture, RowsThatAreNotRead_AreNotMade) {
  std::mt19937 random(4);
  const Picture picture = noise(random, PixelFormat::kI420, 200, 60);  // halved: 100 x 30, chroma 50 x 15
  BlendTable::Source source{PixelFormat::kI420, 200, 60};
  source.levels = 2;
  const Prepared whole(source, picture);
  source.made[0][0] = {false, true, false, true};
  Prepared part(source, picture);
  std::fill(part.memory.begin(), part.memory.end(), std::uint8_t{7});
  prepare_picture(source, picture.view(), part.memory.data(), part.views);
  std::vector<std::uint8_t> expected = bytes_of(whole.views[1].planes[0]);
  for (const int row : {0, 16}) std::fill_n(expected.begin() + 100 * row, 100 * kMadeRows, std::uint8_t{7});
  EXPECT_EQ(bytes_of(part.views[1].planes[0]), expected);
  EXPECT_EQ(bytes_of(part.views[1].planes[2]), bytes_of(whole.views[1].planes[2])) << "chroma is made whole";
}

RC_GTEST_PROP(PreparePicture, AnyPicture_IsWhatTheFormulaSaysAtEveryLevel, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
  BlendTable::Source source{kFormats[random() % 6], 8 + below(300), 8 + below(20)};
  source.sharpen = static_cast<std::uint8_t>(1 + below(kMaxSharpen));
  source.levels = static_cast<std::uint8_t>(1 + below(3));
  const Picture picture = noise(random, source.format, source.width, source.height);
  const ImageView view = halved_chroma(picture.view());
  const Prepared prepared(source, picture);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(source.format)); ++c) {
    const PlaneView& plane = view.planes[c];
    const auto at = [&](int x, int y) -> int {
      const int i = std::clamp(x, 0, plane.width - 1);
      const int j = std::clamp(y, 0, plane.height - 1);
      return plane.data[j * plane.row_stride + i * plane.pixel_stride];
    };
    const PlaneView& out = prepared.views[0].planes[c];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const int detail = 4 * at(x, y) - at(x - 2, y) - at(x + 2, y) - at(x, y - 2) - at(x, y + 2);
        const double exact = at(x, y) + source.sharpen * detail / 64.0;  // sixty-fourths are exact in a double
        RC_ASSERT(out.data[y * out.row_stride + x] == std::clamp(std::floor(exact + 0.5), 0.0, 255.0));
      }
    }
    std::vector<std::uint8_t> larger = bytes_of(plane);
    int width = plane.width;
    for (std::size_t level = 1; level < source.pictures(); ++level) {
      const PlaneView& small = prepared.views[level].planes[c];
      RC_ASSERT(small.width == width / 2);
      std::vector<std::uint8_t> expected;
      for (int y = 0; y < small.height; ++y) {
        for (int x = 0; x < small.width; ++x) {
          const auto from = static_cast<std::size_t>(2 * y * width + 2 * x);
          const auto below_it = from + static_cast<std::size_t>(width);
          const int sum = larger[from] + larger[from + 1] + larger[below_it] + larger[below_it + 1];
          expected.push_back(static_cast<std::uint8_t>((sum + 2) / 4));
        }
      }
      RC_ASSERT(bytes_of(small) == expected);
      larger = expected;
      width = small.width;
    }
  }
}

RC_GTEST_PROP(PreparePicture, TheLowPicture_IsTheMeanOfTheRowsThatItNames_OverNineSquares, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
  const bool large = random() % 4 == 0;  // several pieces of a row at a time
  BlendTable::Source source{kFormats[random() % 6], (large ? 8000 : 4) + below(300), 4 + below(90)};
  source.sharpen = static_cast<std::uint8_t>(below(3));
  source.levels = static_cast<std::uint8_t>(1 + below(2));
  source.low_size = static_cast<std::uint16_t>(16 << below(large ? 2 : 5));
  Picture picture = noise(random, source.format, source.width, source.height);
  if (random() % 4 == 0) std::ranges::fill(picture.bytes, std::uint8_t{255});  // the largest sums
  const ImageView view = halved_chroma(picture.view());
  const Prepared prepared(source, picture);
  RC_ASSERT(source.pictures() == source.levels + 1U);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(source.format)); ++c) {
    const PlaneView& plane = view.planes[c];
    const PlaneView& low = prepared.views[source.levels].planes[c];
    const int n = source.low_size / (has_chroma(source.format) && c > 0 ? 2 : 1);
    RC_ASSERT(low.width == std::max(1, plane.width / n));
    RC_ASSERT(low.height == std::max(1, plane.height / n));
    // The sample of a square; beyond the low picture's edge, that of the edge square.
    const auto square = [&](int x, int y) {
      x = std::clamp(x, 0, low.width - 1);
      y = std::clamp(y, 0, low.height - 1);
      double sum = 0;
      LowSample sample{0, 255, 0};
      for (const int row : {n / 4, 3 * n / 4}) {
        const int line = std::min(n * y + row, plane.height - 1);
        for (int k = 0; k < n; ++k) {
          const int column = std::min(n * x + k, plane.width - 1);
          const std::uint8_t level = plane.data[line * plane.row_stride + column * plane.pixel_stride];
          sum += level;
          sample.least = std::min(sample.least, level);
          sample.most = std::max(sample.most, level);
        }
      }
      sample.mean = static_cast<std::uint16_t>(std::floor(sum / (2 * n) * 128 + 0.5));
      return sample;
    };
    const auto mean_of_row = [&](int x, int y) {
      return std::floor((square(x - 1, y).mean + 2.0 * square(x, y).mean + square(x + 1, y).mean) / 4 + 0.5);
    };
    for (int y = 0; y < low.height; ++y) {
      for (int x = 0; x < low.width; ++x) {
        LowSample expected{0, 255, 0};
        for (int k = 0; k < 9; ++k) {
          const LowSample near = square(x + k % 3 - 1, y + k / 3 - 1);
          expected.least = std::min(expected.least, near.least);
          expected.most = std::max(expected.most, near.most);
        }
        LowSample sample;
        std::memcpy(&sample, low.data + y * low.row_stride + x * low.pixel_stride, sizeof sample);
        RC_ASSERT(sample.mean ==
                  std::floor((mean_of_row(x, y - 1) + 2 * mean_of_row(x, y) + mean_of_row(x, y + 1)) / 4 + 0.5));
        RC_ASSERT(sample.least == expected.least);
        RC_ASSERT(sample.most == expected.most);
      }
    }
  }
}

TEST(PreparePicture, TheLowPictureOfSamplesFarApart_IsThatOfTheSameSamplesPacked) {
  std::mt19937 random(8);
  const Picture packed = noise(random, PixelFormat::kGrey8, 70, 50);
  constexpr int kApart = 6;
  std::vector<std::uint8_t> spread(packed.bytes.size() * kApart);
  for (std::size_t s = 0; s < packed.bytes.size(); ++s) spread[s * kApart] = packed.bytes[s];
  ImageView view = packed.view();
  view.planes[0] = {spread.data(), 70, 50, 70 * kApart, kApart};
  BlendTable::Source source{PixelFormat::kGrey8, 70, 50};
  source.low_size = 16;
  std::vector<std::uint8_t> memory(prepared_size(source));
  std::array<ImageView, kMaxPictures> views;
  prepare_picture(source, view, memory.data(), views);
  const Prepared expected(source, packed);
  ASSERT_EQ(views[1].bytes, expected.views[1].bytes);
  EXPECT_EQ(std::memcmp(views[1].planes[0].data, expected.views[1].planes[0].data, views[1].bytes), 0);
}

}  // namespace
}  // namespace nodal::blend::test
