// What must hold for every table and every picture.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <thread>

#include "small_tables.h"

namespace nodal::blend::test {
namespace {

constexpr std::array kHeadFormats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy};

/// A sample sharpened as blend.h says, by floor(x / 64 + 1/2) on rationals.
int sharpened(const PlaneView& plane, int x, int y, int sharpen) {
  const auto at = [&](int i, int j) -> int {
    const int ci = std::clamp(i, 0, plane.width - 1);
    const int cj = std::clamp(j, 0, plane.height - 1);
    return plane.data[cj * plane.row_stride + ci * plane.pixel_stride];
  };
  const int difference = 4 * at(x, y) - at(x - 1, y) - at(x + 1, y) - at(x, y - 1) - at(x, y + 1);
  const double exact = at(x, y) + sharpen * difference / 64.0;  // sixty-fourths are exact in a double
  return static_cast<int>(std::clamp(std::floor(exact + 0.5), 0.0, 255.0));
}

/// The result by the definition in blend.h, in 128-bit fractions and without any of the kernel's shortcuts.
std::uint8_t by_definition(const BlendTable& table, const std::vector<ImageView>& heads, int c, int x, int y) {
  const ComponentRule& rule = table.components[static_cast<std::size_t>(c)];
  const GridTable& grid = table.grids[rule.grid];
  const auto index = static_cast<std::size_t>(y * grid.width + x);
  __int128 sum = 0;
  __int128 weights = 0;
  for (std::uint32_t t = grid.first[index]; t < grid.first[index + 1]; ++t) {
    const Tap& tap = grid.taps[t];
    const PlaneView& plane = heads[tap.head].planes[static_cast<std::size_t>(c)];
    if (heads[tap.head].planes[0].data == nullptr) continue;
    __int128 value = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const int i = corner & 1;
      const int j = corner >> 1;
      const int share_x = i == 1 ? tap.fraction_x : 4096 - tap.fraction_x;
      const int share_y = j == 1 ? tap.fraction_y : 4096 - tap.fraction_y;
      const int sample = sharpened(plane, tap.x + i, tap.y + j, table.sources[tap.head].sharpen);
      value += __int128{share_x} * share_y * (sample - rule.black);
    }
    const int gain = std::min(32767, (tap.gain * table.sources[tap.head].gain[rule.gain_row] + 2048) / 4096);
    sum += value * gain * tap.weight;
    weights += tap.weight;
  }
  if (weights == 0) return rule.black;
  const __int128 one = weights * 4096 * 4096 * 4096;
  // Floor of (black + sum / one + 1/2), moved up by 2^40 levels so that the division never sees a sign.
  const __int128 up = __int128{1} << 40;
  const __int128 level = (2 * (sum + (rule.black + up) * one) + one) / (2 * one) - up;
  return static_cast<std::uint8_t>(std::clamp<__int128>(level, 0, 255));
}

struct Scene {
  BlendTable table;
  std::vector<Picture> pictures;
  std::vector<ImageView> heads;
};

/// A random table over noise; each head is missing with a chance of one in `missing_in`, never for 0.
Scene random_scene(std::uint32_t seed, bool yuv, unsigned missing_in) {
  std::mt19937 random(seed);
  const PixelFormat head_format = yuv ? kHeadFormats[random() % 4] : PixelFormat::kRgb24;
  const int width = 1 + static_cast<int>(random() % 12);
  const int height = 1 + static_cast<int>(random() % 12);
  Scene scene{random_table(random, yuv ? PixelFormat::kI420 : PixelFormat::kRgb24, head_format, width, height, 3, 9,
                           7, true),
              {},
              {}};
  for (int h = 0; h < 3; ++h) scene.pictures.push_back(noise(random, head_format, 9, 7));
  for (const Picture& picture : scene.pictures) {
    scene.heads.push_back(missing_in != 0 && random() % missing_in == 0 ? ImageView{} : picture.view());
  }
  return scene;
}

RC_GTEST_PROP(BlendRows, AnyTableAndPictures_GiveWhatTheDefinitionSays, (std::uint32_t seed, bool yuv)) {
  const Scene scene = random_scene(seed, yuv, 4);
  Picture raymap(scene.table.format, scene.table.width, scene.table.height, 77);
  const MutableImageView view = raymap.mutable_view();
  blend_rows(scene.table, scene.heads, view, 0, scene.table.height);
  for (int c = 0; c < 3; ++c) {
    const MutablePlaneView& plane = view.planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        RC_ASSERT(plane.data[y * plane.row_stride + x * plane.pixel_stride] ==
                  by_definition(scene.table, scene.heads, c, x, y));
      }
    }
  }
}

RC_GTEST_PROP(BlendRows, AnySplitIntoBands_GivesTheSameBytes, (std::uint32_t seed, bool yuv)) {
  const Scene scene = random_scene(seed, yuv, 8);
  const int height = scene.table.height;
  Picture whole(scene.table.format, scene.table.width, height, 77);
  blend_rows(scene.table, scene.heads, whole.mutable_view(), 0, height);

  Picture bands(scene.table.format, scene.table.width, height, 33);
  std::vector<int> cuts{0};
  while (cuts.back() < height) cuts.push_back(std::min(height, cuts.back() + 2 * *rc::gen::inRange(1, 4)));
  for (std::size_t b = cuts.size() - 1; b > 0; --b) {
    blend_rows(scene.table, scene.heads, bands.mutable_view(), cuts[b - 1], cuts[b]);
  }
  RC_ASSERT(bands.bytes == whole.bytes);
}

RC_GTEST_PROP(BlendRows, ConstantScene_GivesExactlyThatConstantWhereCovered, (std::uint32_t seed, std::uint8_t level)) {
  std::mt19937 random(seed);
  const PixelFormat head_format = kHeadFormats[random() % 4];
  const BlendTable table = random_table(random, PixelFormat::kI420, head_format, 11, 9, 3, 9, 7, false);
  const Picture head(head_format, 9, 7, level);
  const bool lose_one = random() % 2 == 0;
  const std::vector<ImageView> heads{lose_one ? ImageView{} : head.view(), head.view(), head.view()};
  Picture raymap(PixelFormat::kI420, 11, 9);
  const MutableImageView view = raymap.mutable_view();
  blend_rows(table, heads, view, 0, 9);
  for (std::size_t c = 0; c < 3; ++c) {
    const GridTable& grid = table.grids[table.components[c].grid];
    for (int s = 0; s < grid.width * grid.height; ++s) {
      bool covered = false;
      for (auto t = grid.first[static_cast<std::size_t>(s)]; t < grid.first[static_cast<std::size_t>(s) + 1]; ++t) {
        covered |= heads[grid.taps[t].head].planes[0].data != nullptr;
      }
      RC_ASSERT(view.planes[c].data[s] == (covered ? level : table.components[c].black));
    }
  }
}

TEST(BlendRows, YuyvUyvyAndNv12ReadInPlace_EqualTheSamePlanesApart) {
  std::mt19937 random(7);
  for (const PixelFormat format : {PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    const BlendTable table = random_table(random, PixelFormat::kI420, format, 10, 8, 1, 8, 6, true);
    const Picture packed = noise(random, format, 8, 6);
    // The same samples, each component in rows of its own.
    std::array<std::vector<std::uint8_t>, 3> planes;
    ImageView apart = packed.view();
    for (std::size_t c = 0; c < 3; ++c) {
      PlaneView& plane = apart.planes[c];
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          planes[c].push_back(plane.data[y * plane.row_stride + x * plane.pixel_stride]);
        }
      }
      plane = {planes[c].data(), plane.width, plane.height, plane.width, 1};
    }
    Picture in_place(PixelFormat::kI420, 10, 8);
    Picture unpacked(PixelFormat::kI420, 10, 8);
    blend_rows(table, std::vector{packed.view()}, in_place.mutable_view(), 0, 8);
    blend_rows(table, std::vector{apart}, unpacked.mutable_view(), 0, 8);
    EXPECT_EQ(in_place.bytes, unpacked.bytes) << pixel_format_name(format);
  }
}

TEST(BlendRows, BandsOnFourThreads_GiveTheSameBytes) {
  std::mt19937 random(11);
  const BlendTable table = random_table(random, PixelFormat::kI420, PixelFormat::kI420, 64, 64, 4, 32, 32, true);
  std::vector<Picture> pictures;
  std::vector<ImageView> heads;
  for (int h = 0; h < 4; ++h) pictures.push_back(noise(random, PixelFormat::kI420, 32, 32));
  for (const Picture& picture : pictures) heads.push_back(picture.view());
  Picture one(PixelFormat::kI420, 64, 64);
  Picture four(PixelFormat::kI420, 64, 64);
  blend_rows(table, heads, one.mutable_view(), 0, 64);
  {
    std::vector<std::jthread> threads;
    for (int band = 0; band < 4; ++band) {
      threads.emplace_back([&, band] { blend_rows(table, heads, four.mutable_view(), 16 * band, 16 * band + 16); });
    }
  }
  EXPECT_EQ(one.bytes, four.bytes);
}

}  // namespace
}  // namespace nodal::blend::test
