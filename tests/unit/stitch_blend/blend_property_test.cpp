// Properties of every table, picture, tone and kernel.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <thread>

#include "definition.h"
#include "small_tables.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::blend::test {
namespace {

constexpr std::array kHeadFormats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy};

struct Scene {
  BlendTable table;
  SetTone tone;
  std::vector<Picture> pictures;
  std::shared_ptr<nodal::test::PreparedHeads> prepared;
  std::vector<ImageView> heads;  ///< prepared
};

struct Kind {
  PixelFormat raymap;
  PixelFormat head;
};
Kind random_kind(RandomTables& tables) {
  const bool deep = tables.below(3) == 0;
  switch (tables.below(3)) {
    case 0: return {deep ? PixelFormat::kGrey16 : PixelFormat::kGrey8, PixelFormat::kGrey8};
    case 1: return {deep ? PixelFormat::kRgb48 : PixelFormat::kRgb24, PixelFormat::kRgb24};
    default: {
      const PixelFormat raymap = tables.below(2) == 0 ? PixelFormat::kI420 : PixelFormat::kNv12;
      return {raymap, kHeadFormats[static_cast<std::size_t>(tables.below(4))]};
    }
  }
}

/// Areas of 8 x 8 samples of one level each, as of clipped light: unlike noise, they stay what they are when reduced.
Picture areas(std::mt19937& random, PixelFormat format, int width, int height) {
  Picture picture(format, width, height);
  for (int c = 0; c < component_count(format); ++c) {
    const auto plane = picture.mutable_view().planes[static_cast<std::size_t>(c)];
    std::array<std::uint8_t, 256> levels{};
    for (auto& level : levels) level = static_cast<std::uint8_t>(random());
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride] =
            levels[static_cast<std::size_t>(y / 8 * 16 + x / 8) % levels.size()];
      }
    }
  }
  return picture;
}

/// A random table over noise or areas; each head is missing with probability 1 / missing_in, never for 0.
Scene random_scene(RandomTables& tables, int width, int height, int head_width, int head_height, int missing_in) {
  const Kind kind = random_kind(tables);
  Scene scene{tables.table(kind.raymap, kind.head, width, height, 3, head_width, head_height), {}, {}, {}, {}};
  scene.tone = tables.tone(scene.table);
  if (tables.below(3) == 0) {
    scene.tone.confidence.emplace();
    for (auto& head : scene.tone.confidence->of_level) {
      const bool never = tables.below(3) == 0;  // whatever the level
      for (auto& c : head) c = static_cast<std::uint8_t>(never || tables.below(3) == 0 ? 0 : tables.below(256));
    }
  }
  if (tables.below(3) == 0) {
    scene.tone.fade.emplace();
    for (auto& left : scene.tone.fade->of_luma) left = static_cast<std::uint16_t>(tables.below(kScaleOne + 1));
  }
  const auto shown = tables.below(2) == 0 ? noise : areas;
  for (int h = 0; h < 3; ++h) scene.pictures.push_back(shown(tables.random(), kind.head, head_width, head_height));
  std::vector<ImageView> heads;
  for (const Picture& picture : scene.pictures) {
    heads.push_back(missing_in != 0 && tables.below(missing_in) == 0 ? ImageView{} : picture.view());
  }
  scene.prepared = std::make_shared<nodal::test::PreparedHeads>(scene.table, heads);
  scene.heads.assign(scene.prepared->views().begin(), scene.prepared->views().end());
  return scene;
}

Picture blended(Kernel kernel, const Scene& scene, std::uint8_t fill = 77) {
  Picture raymap(scene.table.format, scene.table.width, scene.table.height, fill);
  blend_rows_by(kernel, scene.table, scene.heads, scene.tone, raymap.mutable_view(), 0, scene.table.height);
  return raymap;
}

RC_GTEST_PROP(BlendRows, AnyTablePicturesAndTone_GiveWhatTheDefinitionSays, (std::uint32_t seed)) {
  RandomTables tables(seed);
  const int side = 8 + tables.below(40);  // some are smaller than a patch
  const Scene scene = random_scene(tables, 1 + tables.below(90), 1 + tables.below(40), side, side + 3, 4);
  const Definition definition(scene.table, scene.heads, scene.tone);
  for (const Kernel kernel : kernels()) {
    const Picture raymap = blended(kernel, scene);
    for (int c = 0; c < component_count(scene.table.format); ++c) {
      const PlaneView plane = raymap.view().planes[static_cast<std::size_t>(c)];
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          RC_ASSERT(sample_of(raymap.view(), c, x, y) == definition.level(c, x, y));
        }
      }
    }
  }
}

#if defined(__aarch64__)
constexpr std::size_t kTilesByEveryKernel = 50'000;  // as a rule an emulated kernel
#else
constexpr std::size_t kTilesByEveryKernel = 1'000'000;
#endif

TEST(BlendRows, AMillionTilesByEveryKernel_AreTheSameBytes) {
  if (kernels().size() == 1) GTEST_SKIP() << "this processor has the scalar kernel alone";
  RandomTables tables(2026);
  std::size_t tiles = 0;
  while (tiles < kTilesByEveryKernel) {
    Scene scene = random_scene(tables, 256, 128, 64, 48, 0);
    scene.tone.confidence.reset();  // confidence uses the same slow code in all kernels
    for (int again = 0; again < 12; ++again) {
      scene.tone = tables.tone(scene.table);
      const Picture expected = blended(Kernel::kScalar, scene);
      for (const Kernel kernel : kernels().subspan(1)) {
        ASSERT_EQ(blended(kernel, scene).bytes, expected.bytes)
            << kernel_name(kernel) << " after " << tiles << " tiles";
      }
      for (const GridTable& grid : scene.table.grids) tiles += grid.tile_count();
    }
  }
}

RC_GTEST_PROP(BlendRows, AnySplitIntoBands_GivesTheSameBytes, (std::uint32_t seed)) {
  RandomTables tables(seed);
  Scene scene = random_scene(tables, 1 + tables.below(140), 1 + tables.below(140), 40, 30, 8);
  const int height = scene.table.height;
  for (const Kernel kernel : kernels()) {
    const Picture whole = blended(kernel, scene);
    Picture bands(scene.table.format, scene.table.width, height, 33);
    std::vector<int> cuts{0};
    while (cuts.back() < height) cuts.push_back(std::min(height, cuts.back() + 2 * *rc::gen::inRange(1, 40)));
    for (std::size_t b = cuts.size() - 1; b > 0; --b) {
      blend_rows_by(kernel, scene.table, scene.heads, scene.tone, bands.mutable_view(), cuts[b - 1], cuts[b]);
    }
    RC_ASSERT(bands.bytes == whole.bytes);
  }
}

RC_GTEST_PROP(BlendRows, ConstantScene_GivesExactlyThatConstantWhereCovered, (std::uint32_t seed, std::uint8_t level)) {
  RandomTables tables(seed);
  const PixelFormat head_format = kHeadFormats[static_cast<std::size_t>(tables.below(4))];
  BlendTable table = tables.table(PixelFormat::kI420, head_format, 91, 67, 3, 40, 34);
  for (GridTable& grid : table.grids) grid.gains.clear();
  for (GridTable& grid : table.cover) grid.gains.clear();
  for (GridTable& grid : table.grids) {
    for (LowSight& sight : grid.low.sights) sight.gain = 0;
  }
  table.vignetting_scale = 256;
  const Picture head(head_format, 40, 34, level);
  const bool lose_one = tables.below(2) == 0;
  const nodal::test::PreparedHeads prepared(
      table, std::vector<ImageView>{lose_one ? ImageView{} : head.view(), head.view(), head.view()});
  const auto heads = prepared.views();
  for (const Kernel kernel : kernels()) {
    Picture raymap(PixelFormat::kI420, 91, 67);
    const MutableImageView view = raymap.mutable_view();
    blend_rows_by(kernel, table, heads, calibrated_tone(table), view, 0, 67);
    Picture validity(PixelFormat::kGrey8, 91, 67);
    validity_rows(table, heads, validity.mutable_view().planes[0], 0, 67);
    for (std::size_t s = 0; s < validity.bytes.size(); ++s) {
      RC_ASSERT(view.planes[0].data[s] == (validity.bytes[s] > 0 ? level : 16));
    }
    for (std::size_t c = 1; c < 3; ++c) {
      for (int s = 0; s < 46 * 34; ++s) RC_ASSERT(view.planes[c].data[s] == level || view.planes[c].data[s] == 128);
    }
  }
}

TEST(BlendRows, YuyvUyvyAndNv12ReadInPlace_EqualTheSamePlanesApart) {
  RandomTables tables(7);
  for (const PixelFormat format : {PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    const BlendTable table = tables.table(PixelFormat::kI420, format, 100, 80, 1, 70, 46);
    const Picture packed = noise(tables.random(), format, 70, 46);
    // The same samples, each component in its own plane.
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
    Picture in_place(PixelFormat::kI420, 100, 80);
    Picture unpacked(PixelFormat::kI420, 100, 80);
    const SetTone tone = calibrated_tone(table);
    for (const Kernel kernel : kernels()) {
      const nodal::test::PreparedHeads of_packed(table, std::vector{packed.view()});
      const nodal::test::PreparedHeads of_apart(table, std::vector{apart});
      blend_rows_by(kernel, table, of_packed.views(), tone, in_place.mutable_view(), 0, 80);
      blend_rows_by(kernel, table, of_apart.views(), tone, unpacked.mutable_view(), 0, 80);
      EXPECT_EQ(in_place.bytes, unpacked.bytes) << pixel_format_name(format) << " by " << kernel_name(kernel);
    }
  }
}

TEST(BlendRows, PixelsThatLieAnywhere_AreThoseOfTheirTilesInEveryFormat) {
  RandomTables tables(5);
  for (int round = 0; round < 40; ++round) {
    Scene scene = random_scene(tables, 1 + tables.below(90), 2 * (1 + tables.below(20)), 40, 30, 8);
    scene.tone.fade.reset();
    const Picture in_order = blended(Kernel::kScalar, scene);
    std::array<std::vector<std::pair<int, int>>, 2> at;  // by grid: the positions of its pixels
    for (std::size_t g = 0; g < scene.table.grids.size(); ++g) {
      GridTable& grid = scene.table.grids[g];
      for (int p = 0; p < grid.width * grid.height; ++p) at[g].emplace_back(p % grid.width, p / grid.width);
      std::ranges::shuffle(at[g], tables.random());
      grid.places.assign(grid.tile_count() * kTilePixels, GridTable::kNowhere);
      for (int p = 0; p < grid.width * grid.height; ++p) {
        const int x = p % grid.width, y = p / grid.width;
        const auto [to_x, to_y] = at[g][static_cast<std::size_t>(p)];
        grid.places[grid.tile_index(x / 8, y / 8) * kTilePixels + static_cast<std::size_t>(y % 8 * 8 + x % 8)] =
            static_cast<std::uint32_t>(to_x | to_y << 16);
      }
    }
    for (const Kernel kernel : kernels()) {
      const Picture anywhere = blended(kernel, scene);
      for (int c = 0; c < component_count(scene.table.format); ++c) {
        const std::size_t g = scene.table.components[static_cast<std::size_t>(c)].grid;
        const GridTable& grid = scene.table.grids[g];
        for (int p = 0; p < grid.width * grid.height; ++p) {
          const auto [x, y] = at[g][static_cast<std::size_t>(p)];
          ASSERT_EQ(sample_of(anywhere.view(), c, x, y), sample_of(in_order.view(), c, p % grid.width, p / grid.width))
              << kernel_name(kernel) << " of " << pixel_format_name(scene.table.format);
        }
      }
    }
  }
}

TEST(BlendRows, RowsThatBeginAnywhereInACacheLine_AreTheSameBytes_AndNothingBesideThemIsWritten) {
  RandomTables tables(64);
  for (int trial = 0; trial < 150; ++trial) {
    Scene scene = random_scene(tables, 60 + tables.below(330), 8 + tables.below(90), 40, 30, 0);
    const int width = scene.table.width, height = scene.table.height;
    const Picture expected = blended(Kernel::kScalar, scene);
    const std::size_t size = expected.bytes.size();
    for (const Kernel kernel : kernels()) {
      constexpr std::size_t kBeside = 192;
      std::vector<std::uint8_t> memory(size + 2 * kBeside, 99);
      const std::size_t begin = kBeside / 2 + static_cast<std::size_t>(tables.below(64));
      const MutableImageView raymap = packed_image(scene.table.format, width, height, memory.data() + begin);
      const int cut = std::min(height, 2 * tables.below(30));
      blend_rows_by(kernel, scene.table, scene.heads, scene.tone, raymap, cut, height);
      blend_rows_by(kernel, scene.table, scene.heads, scene.tone, raymap, 0, cut);
      const auto from = memory.begin() + static_cast<std::ptrdiff_t>(begin);
      const auto to = from + static_cast<std::ptrdiff_t>(size);
      ASSERT_TRUE(std::equal(from, to, expected.bytes.begin())) << kernel_name(kernel) << " " << width << "x" << height;
      const auto untouched = [](std::uint8_t byte) { return byte == 99; };
      ASSERT_TRUE(std::all_of(memory.begin(), from, untouched) && std::all_of(to, memory.end(), untouched))
          << kernel_name(kernel) << " " << width << "x" << height;
    }
  }
}

TEST(BlendRows, BandsOnFourThreads_GiveTheSameBytes) {
  RandomTables tables(11);
  Scene scene = random_scene(tables, 256, 256, 32, 32, 0);
  const Picture one = blended(kernels().back(), scene);
  Picture four(scene.table.format, 256, 256);
  {
    std::vector<std::jthread> threads;
    for (int band = 0; band < 4; ++band) {
      threads.emplace_back([&, band] {
        blend_rows(scene.table, scene.heads, scene.tone, four.mutable_view(), 64 * band, 64 * band + 64);
      });
    }
  }
  EXPECT_EQ(one.bytes, four.bytes);
}

}  // namespace
}  // namespace nodal::blend::test
