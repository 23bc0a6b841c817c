// Tables whose seams lie where a map says: proven like any other, and they show the head that the map names.
#include "stitch/table/seamed_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/validate.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::table {
namespace {

constexpr int kHeadSide = 64;
constexpr int kMapWidth = 64;

std::vector<std::uint8_t> labels_of(const std::function<std::uint8_t(int, int)>& head) {
  std::vector<std::uint8_t> labels;
  for (int k = 0; k < kMapWidth * kMapWidth / 2; ++k) labels.push_back(head(k % kMapWidth, k / kMapWidth));
  return labels;
}

/// A raymap of heads that each show one level.
std::vector<std::uint8_t> flat_raymap(const blend::BlendTable& table, const std::vector<std::uint8_t>& levels,
                                      std::optional<blend::Kernel> kernel = {}) {
  std::vector<std::vector<std::uint8_t>> bytes;
  std::vector<ImageView> pictures;
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    bytes.emplace_back(static_cast<std::size_t>(table.sources[h].width * table.sources[h].height), levels[h]);
    pictures.push_back(packed_image(PixelFormat::kGrey8, table.sources[h].width, table.sources[h].height,
                                    std::as_const(bytes[h]).data()));
  }
  std::vector<std::uint8_t> raymap(static_cast<std::size_t>(table.width * table.height));
  const MutableImageView into = packed_image(table.format, table.width, table.height, raymap.data());
  const test::PreparedHeads prepared(table, pictures);
  const blend::SetTone tone = blend::calibrated_tone(table);
  if (kernel) blend::blend_rows_by(*kernel, table, prepared.views(), tone, into, 0, table.height);
  else blend::blend_rows(table, prepared.views(), tone, into, 0, table.height);
  return raymap;
}

struct Compiled {
  std::unique_ptr<geometry::RaymapLayout> layout;
  blend::BlendTable table;
};
Compiled compiled(const Calibration& rig, const std::string& layout, int width, int height,
                  Transition transition = Transition::kSeam) {
  Compiled made{geometry::make_layout(layout, width, height).value(), {}};
  TableOptions options;
  options.transition = transition;
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kGrey8);
  made.table = compile_blend_table(rig, *made.layout, PixelFormat::kGrey8, formats, options).value();
  return made;
}

/// Level of each head of cube_rig().
std::vector<std::uint8_t> levels() { return {20, 60, 100, 140, 180, 220}; }

TEST(SeamedTable, AMapOfOneHead_ShowsItWhereverItSees) {
  const Calibration rig = test::cube_rig(kHeadSide);
  const Compiled made = compiled(rig, "equirectangular", 256, 128);
  const SeamedTable seamed(made.table, *made.layout, kMapWidth, 1);
  const std::vector<geometry::Head> heads = geometry::make_heads(rig).value();
  for (std::uint8_t h = 0; h < 6; ++h) {
    const blend::BlendTable table = seamed.with(made.table, {}, labels_of([&](int, int) { return h; })).table;
    ASSERT_TRUE(validate_blend_table(table));
    const std::vector<std::uint8_t> raymap = flat_raymap(table, levels());
    for (std::size_t p = 0; p < raymap.size(); ++p) {
      const auto ray = made.layout->ray(static_cast<double>(p % 256) + 0.5, static_cast<double>(p / 256) + 0.5);
      const auto at = heads[h].project(*ray);
      const double inside = at ? heads[h].distance_to_edge(*at) : -1;
      if (inside > 1) {
        ASSERT_EQ(raymap[p], levels()[h]) << p;
      } else if (inside < -1) {
        ASSERT_NE(raymap[p], levels()[h]) << p;
        ASSERT_NE(raymap[p], 0) << "another head shows it: " << p;
      }
    }
  }
}

/// The place along a row, in degrees of yaw from 0, where the raymap's level passes `level`.
double crossing(const std::vector<std::uint8_t>& row, double level) {
  const int width = static_cast<int>(row.size());
  for (int x = width / 2; x + 1 < width; ++x) {
    const double a = row[static_cast<std::size_t>(x)], b = row[static_cast<std::size_t>(x + 1)];
    if (a < level && b >= level) return (x + 0.5 + (level - a) / (b - a) - width / 2.0) / width * 360;
  }
  return -1;
}

TEST(SeamedTable, AStraightSeam_HasARampOfItsWidthInItsMiddle) {
  // 2048 columns around, and only rows near the equator.
  const geometry::RaymapSize size = geometry::LayoutName::parse("central_cylinder:fov=10").value().size_for_width(2048);
  const Compiled made = compiled(test::cube_rig(256), "central_cylinder:fov=10", size.width, size.height);
  ASSERT_EQ(size.width, 2048);
  for (const double seam_width : {0.0, 3.0, 5.0}) {
    const SeamedTable seamed(made.table, *made.layout, kMapWidth, seam_width);
    // Heads 0 and 1 look along yaw 0 and 90; both see 37 to 53 degrees. The column's edge is at 8 / 64 of a circle.
    const auto labels = labels_of([](int x, int) { return static_cast<std::uint8_t>(x < kMapWidth / 2 + 8 ? 0 : 1); });
    const auto raymap = flat_raymap(seamed.with(made.table, {}, labels).table, {0, 200, 0, 0, 0, 0});
    const auto middle = raymap.begin() + size.height / 2 * 2048;
    const std::vector<std::uint8_t> row(middle, middle + 2048);
    const double ramp = crossing(row, 180) - crossing(row, 20);  // 8/10 of it
    EXPECT_NEAR((crossing(row, 180) + crossing(row, 20)) / 2, 45, 0.15) << seam_width;
    EXPECT_NEAR(ramp, std::max(0.14, 0.8 * seam_width), 0.2 + 0.1 * seam_width) << seam_width;
  }
}

class AnyLayout : public testing::TestWithParam<const char*> {};

TEST_P(AnyLayout, AnyMap_GivesAProvenTableThatAllKernelsBlendAlike) {
  std::mt19937 random(7);
  for (int k = 0; k < 12; ++k) {
    const Calibration rig = k % 3 == 0 ? test::cube_rig(kHeadSide) : test::random_rig(random);
    const auto name = geometry::LayoutName::parse(GetParam()).value();
    const geometry::RaymapSize size = name.size_for_width(120);
    Compiled made{geometry::make_layout(name, size.width, size.height).value(), {}};
    const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kI420);
    const auto table = compile_blend_table(rig, *made.layout, PixelFormat::kI420, formats, {});
    if (!table) continue;  // drawn rigs may see nothing
    const SeamedTable seamed(*table, *made.layout, kMapWidth, 1 + k);
    const auto labels = labels_of([&](int x, int y) {
      const std::uint32_t drawn =
          k % 2 == 0 ? static_cast<std::uint32_t>(x / 5 + y / 7) : static_cast<std::uint32_t>(random());
      return static_cast<std::uint8_t>(drawn % 5 == 4 ? SeamedTable::kNoHead : drawn % rig.heads.size());
    });
    const blend::BlendTable moved = seamed.with(*table, {}, labels).table;
    const Status proven = validate_blend_table(moved);
    ASSERT_TRUE(proven) << proven.error().text();
    // Step by step from other labels: the same table, and only what changed is made.
    auto others = labels;
    for (int y = 10; y < 16; ++y)
      for (int x = 20; x < 30; ++x) others[static_cast<std::size_t>(y * kMapWidth + x)] = 0;
    const SeamedTable::Moved step = seamed.with(*table, {}, others);
    const SeamedTable::Moved back = seamed.with(step.table, others, labels);
    for (std::size_t g = 0; g < moved.grids.size(); ++g) {
      EXPECT_EQ(back.table.grids[g].records, moved.grids[g].records);
      EXPECT_EQ(back.table.grids[g].weights, moved.grids[g].weights);
      EXPECT_EQ(back.table.grids[g].coordinates, moved.grids[g].coordinates);
      EXPECT_LE(std::ranges::count(back.made[g], true), std::ranges::count(step.made[g], true) / 2);
    }

    std::vector<std::vector<std::uint8_t>> bytes;
    std::vector<ImageView> pictures;
    for (const blend::BlendTable::Source& source : moved.sources) {
      auto& picture = bytes.emplace_back(packed_size(source.format, source.width, source.height));
      for (std::uint8_t& sample : picture) sample = static_cast<std::uint8_t>(random());
      pictures.push_back(packed_image(source.format, source.width, source.height, std::as_const(picture).data()));
    }
    const test::PreparedHeads prepared(moved, pictures);
    std::optional<std::vector<std::uint8_t>> first;
    for (const blend::Kernel kernel : blend::kernels()) {
      std::vector<std::uint8_t> raymap(packed_size(moved.format, moved.width, moved.height));
      blend::blend_rows_by(kernel, moved, prepared.views(), blend::calibrated_tone(moved),
                           packed_image(moved.format, moved.width, moved.height, raymap.data()), 0, moved.height);
      if (!first) first = raymap;
      EXPECT_TRUE(raymap == *first) << kernel_name(kernel);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(SeamedTable, AnyLayout, testing::Values("equirectangular", "cube", "hammersley"));

TEST(SeamedTable, TilesWithPairsOfRecords_AreCutByASeamLikeOthers) {
  const Compiled made = compiled(test::turned_fisheyes({-40, 40}), "equirectangular", 768, 384);
  const blend::GridTable& cover = made.table.cover[0];
  EXPECT_GT(std::ranges::count_if(cover.records, &blend::PatchRecord::paired), 200);
  const SeamedTable seamed(made.table, *made.layout, kMapWidth, 0);
  // Slanted, so that it crosses tiles in any way, also between their halves.
  const auto labels =
      labels_of([](int x, int y) { return static_cast<std::uint8_t>(x + y / 3 < kMapWidth / 2 + 3 ? 0 : 1); });
  const SeamedTable::Moved moved = seamed.with(made.table, {}, labels);
  const Status proven = validate_blend_table(moved.table);
  ASSERT_TRUE(proven) << proven.error().text();
  const auto raymap = flat_raymap(moved.table, {100, 200}, blend::kernels().front());
  for (const blend::Kernel kernel : blend::kernels()) {
    EXPECT_TRUE(flat_raymap(moved.table, {100, 200}, kernel) == raymap) << kernel_name(kernel);
  }
  for (int y = 120; y < 264; ++y) {  // both heads see yaw -20 .. 20
    for (int x = 384 - 42; x < 384 + 42; ++x) {
      const int u = x * kMapWidth / 768, v = y * kMapWidth / 768;
      const int side = u + v / 3 - (kMapWidth / 2 + 3);
      if (side == 0 || side == -1 || side == 1) continue;  // beside the seam
      ASSERT_EQ(raymap[static_cast<std::size_t>(y * 768 + x)], side < 0 ? 100 : 200) << x << ", " << y;
    }
  }
  // Moved there and back: the same table.
  auto others = labels;
  for (std::uint8_t& label : others) label = 1;
  const SeamedTable::Moved back = seamed.with(seamed.with(moved.table, labels, others).table, others, labels);
  EXPECT_EQ(back.table.grids[0].records, moved.table.grids[0].records);
  EXPECT_EQ(back.table.grids[0].weights, moved.table.grids[0].weights);
  EXPECT_EQ(back.table.grids[0].coordinates, moved.table.grids[0].coordinates);
}

TEST(SeamedTable, TilesOfOneHead_StayAsTheyAre) {
  const Compiled made = compiled(test::cube_rig(kHeadSide), "equirectangular", 256, 128, Transition::kTwoBand);
  const SeamedTable seamed(made.table, *made.layout, kMapWidth, 1);
  const blend::BlendTable moved =
      seamed.with(made.table, {}, labels_of([](int x, int y) { return static_cast<std::uint8_t>((x + y) % 6); })).table;
  const blend::GridTable &own = made.table.grids[0], &cover = made.table.cover[0], &now = moved.grids[0];
  int same = 0, shared = 0;
  for (std::size_t t = 0; t < own.tile_count(); ++t) {
    if (cover.tiles[t].record != cover.tiles[t + 1].record) {
      ++shared;
      continue;
    }
    ASSERT_EQ(now.tiles[t + 1].record - now.tiles[t].record, own.tiles[t + 1].record - own.tiles[t].record);
    for (std::size_t r = own.tiles[t].record; r < own.tiles[t + 1].record; ++r) {
      ASSERT_EQ(now.records[now.tiles[t].record + r - own.tiles[t].record], own.records[r]);
      ++same;
    }
  }
  EXPECT_GT(same, 100);
  EXPECT_GT(shared, 100);
  EXPECT_EQ(now.low.sights, own.low.sights);
}

TEST(SeamedTable, TheProofOfSomeTiles_FindsFaultsInThemOnly) {
  const Compiled made = compiled(test::cube_rig(kHeadSide), "equirectangular", 256, 128);
  const SeamedTable seamed(made.table, *made.layout, kMapWidth, 1);
  const auto labels = labels_of([](int x, int y) { return static_cast<std::uint8_t>((x / 9 + y / 9) % 6); });
  SeamedTable::Moved moved = seamed.with(made.table, {}, labels);
  ASSERT_TRUE(validate_tiles(moved.table, moved.made));
  blend::GridTable& grid = moved.table.grids[0];
  for (std::size_t t = 0; t < grid.tile_count(); ++t) {
    if (!moved.made[0][t] || grid.tiles[t].how() != blend::Sharing::kListed) continue;
    grid.weights[grid.tiles[t].weights()] = 1;  // less than nothing
    EXPECT_FALSE(validate_tiles(moved.table, moved.made));
    moved.made[0][t] = false;
    EXPECT_TRUE(validate_tiles(moved.table, moved.made));
    return;
  }
  FAIL() << "no tile has a ramp";
}

}  // namespace
}  // namespace nodal::table
