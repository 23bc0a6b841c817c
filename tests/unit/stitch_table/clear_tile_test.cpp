// Tiles far from seams get their positions by a polynomial. Each must be what sampling its pixels one by one gives.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "rigs.h"
#include "stitch/table/clear_tile.h"
#include "tests/support/layouts.h"

namespace nodal::table {
namespace {

using test::layout_of;

constexpr int kTileSide = blend::kTile;

struct Tally {
  int tiles = 0;
  int clear = 0;  ///< tiles that clear_tile() finds
  int alone = 0;  ///< tiles of which has_one_head_at_most() is sure
};

/// Compares every `every`-th tile of an RGB24 raymap, and those beside it and below it.
class Comparison {
 public:
  Comparison(const Calibration& rig, const geometry::RaymapLayout& layout, TableOptions options)
      : layout_(layout),
        formats_(rig.heads.size(), PixelFormat::kRgb24),
        seams_(RaySampler::make(rig, layout, PixelFormat::kRgb24, formats_, options).value()),
        all_(RaySampler::make(rig, layout, PixelFormat::kRgb24, formats_, feathered(options)).value()),
        pixels_(seams_),
        heads_(all_) {}

  Tally run(int every) {
    const int across = (layout_.width() + kTileSide - 1) / kTileSide,
              down = (layout_.height() + kTileSide - 1) / kTileSide;
    for (int t = 0; t < across * down && !testing::Test::HasFailure(); ++t) {
      if (t % every > 1 && t % every != across % every) continue;
      compare(t % across * kTileSide, t / across * kTileSide);
    }
    return tally_;
  }

 private:
  static TableOptions feathered(TableOptions options) {
    options.transition = Transition::kFeather;
    return options;
  }
  void compare(int left, int top) {
    SCOPED_TRACE(testing::Message() << layout_.name() << " " << left << "," << top);
    ++tally_.tiles;
    const bool alone = has_one_head_at_most(all_, 0, left, top);
    const std::optional<ClearTile> tile = clear_tile(seams_, 0, left, top);
    tally_.alone += alone ? 1 : 0;
    tally_.clear += tile ? 1 : 0;
    if (!tile && !alone) return;
    std::array<std::uint32_t, blend::kTilePixels> places;
    for (int p = 0; p < blend::kTilePixels; ++p) {
      places[static_cast<std::size_t>(p)] = blend::GridTable::place(left + p % kTileSide, top + p / kTileSide);
    }
    pixels_.sample(0, places);
    heads_.sample(0, places);
    for (int p = 0; p < blend::kTilePixels; ++p) {
      if (alone) {
        EXPECT_LE(heads_.at(p).size(), 1U) << "pixel " << p;
      }
      if (!tile) continue;
      const auto i = static_cast<std::size_t>(p);
      const std::span<const RaySample> at = pixels_.at(p);
      ASSERT_EQ(at.size(), 1U) << "pixel " << p;
      EXPECT_EQ(at[0].head, tile->head);
      // A quarter of what a tile's fit allows, 1/64 of a sample and 1/1400 of a gain.
      EXPECT_NEAR(at[0].x, tile->x[i], 1.0 / 256) << "pixel " << p;
      EXPECT_NEAR(at[0].y, tile->y[i], 1.0 / 256) << "pixel " << p;
      EXPECT_NEAR(at[0].gain, tile->gain[i], 1.0 / 5000) << "pixel " << p;
    }
  }

  const geometry::RaymapLayout& layout_;
  std::vector<PixelFormat> formats_;
  RaySampler seams_, all_;
  RowSampler pixels_, heads_;
  Tally tally_;
};

TableOptions seams(double width_deg) {
  TableOptions options;
  options.transition = Transition::kSeam;
  options.least_weight = 0;
  options.seam_width_deg = width_deg;
  return options;
}

/// Heads of different lenses, with fall-off, that cover the sphere.
Calibration mixed_rig(int side) {
  Calibration rig = test::cube_rig(side);
  for (HeadCalibration& head : rig.heads) head.vignetting.coefficients = {-0.3, 0.05, 0};
  rig.heads[1].lens = EquidistantLens{{side * 0.38, 0, -side * 0.01}};
  rig.heads[1].aspect = 1.05;
  rig.heads[2].lens = KannalaBrandtLens{side * 0.38, {-0.01, 0.002, 0, 0}};
  rig.heads[2].region.circle = {rig.heads[2].center_x + 3, rig.heads[2].center_y, side * 0.49};
  return rig;
}

TEST(ClearTile, EveryLayout_IsWhatItsPixelsAre) {
  const Calibration rig = mixed_rig(1500);
  std::vector<std::string> layouts{"cube:pad=3", "equiangular_cube:pad=2", "central_cylinder:fov=140"};
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) layouts.emplace_back(kind.name);
  for (const std::string& name : layouts) {
    const auto layout = layout_of(name, 2048);
    const Tally tally = Comparison(rig, *layout, seams(2)).run(43);
    if (HasFailure()) return;
    EXPECT_EQ(tally.clear > 0, layout->smooth()) << name;
    if (name == "equirectangular") {
      EXPECT_GT(tally.clear, tally.tiles / 2);
      EXPECT_GT(tally.alone, 0);
    }
  }
}

TEST(ClearTile, AnyRig_IsWhatItsPixelsAre) {
  Tally sum;
  for (unsigned seed = 0; seed < 60 && !HasFailure(); ++seed) {
    std::mt19937 random(seed);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const auto layout = layout_of("equirectangular", 1024);
    const Tally one =
        Comparison(test::random_rig(random), *layout, seams(std::array{0.0, 0.5, 2.0, 10.0}[seed % 4])).run(31);
    sum.clear += one.clear;
    sum.tiles += one.tiles;
  }
  EXPECT_GT(sum.clear, 0);
}

TEST(ClearTile, HeadsOffThePoint_IsWhatItsPixelsAre) {
  Calibration rig = mixed_rig(1500);
  rig.distance = 1;
  for (HeadCalibration& head : rig.heads) {
    const std::array<double, 9>& R = head.R_head_rig;  // its last row is the head's axis in the rig
    head.position = {0.25 * R[6], 0.25 * R[7], 0.25 * R[8]};
  }
  const auto layout = layout_of("equirectangular", 4096);
  EXPECT_GT(Comparison(rig, *layout, seams(2)).run(47).clear, 100);
}

TEST(ClearTile, WithMasksOrWithoutSeams_None) {
  Calibration rig = mixed_rig(1500);
  const auto layout = layout_of("equirectangular", 2048);
  TableOptions feather = seams(2);
  feather.transition = Transition::kFeather;
  EXPECT_EQ(Comparison(rig, *layout, feather).run(43).clear, 0);
  // The score of a head with masks drops within few pixels.
  for (HeadCalibration& head : rig.heads) head.region.masks.push_back({{500, 500}, {900, 500}, {700, 900}});
  EXPECT_EQ(Comparison(rig, *layout, seams(2)).run(43).clear, 0);
}

TEST(ClearTile, ARigOfOneHead_EveryWholeTileHasOneHeadAtMost) {
  const auto layout = layout_of("equirectangular", 64);
  const auto sampler = RaySampler::make(test::turned_fisheyes({0}), *layout, PixelFormat::kGrey8,
                                        std::vector(1, PixelFormat::kGrey8), seams(2))
                           .value();
  for (int top = 0; top < layout->height(); top += kTileSide) {
    for (int left = 0; left < layout->width(); left += kTileSide) {
      EXPECT_TRUE(has_one_head_at_most(sampler, 0, left, top)) << left << "," << top;
    }
  }
}

TEST(ClearTile, InAnOverlapButFarFromItsSeam_OneHeadHasAllOfIt) {
  // Two fisheyes of 110 degrees from the front to the rim, back to back: both see 20 degrees on each side of z = 0.
  Calibration rig;
  rig.name = "two";
  for (const double yaw : {0.0, 180.0}) {
    rig.heads.push_back(
        test::head_at("h" + std::to_string(rig.heads.size()), 1600, 1600, EquidistantLens{{400}}, {yaw, 0, 0}));
    rig.heads.back().max_angle = 110 * std::numbers::pi / 180;
    rig.heads.back().region.circle = {800, 800, 400 * rig.heads.back().max_angle};
  }
  const auto layout = layout_of("equirectangular", 4096);
  const auto sampler =
      RaySampler::make(rig, *layout, PixelFormat::kGrey8, std::vector(2, PixelFormat::kGrey8), seams(2)).value();
  // At the equator a column is 360 / 4096 degrees, and the seams are at columns 1024 and 3072.
  for (const int degrees : {4, 6, 8, 10, 12, 14}) {
    const int left = (1024 + degrees * 4096 / 360) / kTileSide * kTileSide;
    const auto tile = clear_tile(sampler, 0, left, layout->height() / 2);
    ASSERT_TRUE(tile) << degrees;
    EXPECT_EQ(tile->head, 0) << degrees;
  }
}

}  // namespace
}  // namespace nodal::table
