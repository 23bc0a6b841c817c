#include "stitch/table/validate.h"

#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>
#include <utility>

#include "rigs.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {
namespace {

using blend::BlendTable;

const BlendTable& good_table() {
  static const BlendTable table = [] {
    Calibration rig = test::cube_rig(24);
    rig.heads.pop_back();  // leaves a hole
    for (HeadCalibration& head : rig.heads) head.vignetting.coefficients = {-0.1, 0, 0};
    const std::vector<PixelFormat> formats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                           PixelFormat::kUyvy, PixelFormat::kI420};
    TableOptions options;
    options.transition = Transition::kFeather;  // tiles of several heads everywhere
    return compile_blend_table(rig, {"equirectangular", 40, 20, PixelFormat::kI420}, formats, options).value();
  }();
  return table;
}

/// With batches: several of the first grid, one of the second.
const BlendTable& scattered_table() {
  static const BlendTable table = compile_blend_table(test::cube_rig(24), {"hammersley", 400, 200, PixelFormat::kI420},
                                                      std::vector<PixelFormat>(6, PixelFormat::kI420))
                                      .value();
  return table;
}

/// A tile of the first grid whose weights are listed or bilinear, shared by several records.
blend::Tile& shared_tile(BlendTable& table) {
  for (blend::Tile& tile : table.grids[0].tiles) {
    if (tile.how() != blend::Sharing::kAlone && (&tile + 1)->record > tile.record + 1) return tile;
  }
  throw std::logic_error("no tile is shared");
}

/// A tile of the first grid with weights of several records, and how many weights those are.
std::pair<blend::Tile*, std::size_t> widely_shared_tile(BlendTable& table) {
  std::vector<blend::Tile>& tiles = table.grids[0].tiles;
  for (std::size_t t = 0; t + 1 < tiles.size(); ++t) {
    const std::size_t records = tiles[t + 1].record - tiles[t].record;
    const bool open = tiles[t].how() == blend::Sharing::kOpen;
    const std::size_t with_weights = open || records == 0 ? records : records - 1;
    const std::size_t each = tiles[t].how() == blend::Sharing::kBilinear ? 4 : blend::kTilePixels;
    if (tiles[t].how() != blend::Sharing::kAlone && with_weights > 1) return {&tiles[t], with_weights * each};
  }
  throw std::logic_error("no tile has weights of several records");
}

/// A record of the first grid with polynomial coordinates.
blend::PatchRecord& plain_record(BlendTable& table) {
  for (blend::PatchRecord& record : table.grids[0].records) {
    if (!record.listed()) return record;
  }
  throw std::logic_error("every record is listed");
}

/// A table with pairs of records.
const BlendTable& paired_table() {
  static const BlendTable table =
      compile_blend_table(test::turned_fisheyes({-40, 40}), {"equirectangular", 768, 384, PixelFormat::kGrey8},
                          std::vector(2, PixelFormat::kGrey8))
          .value();
  return table;
}

/// The first record of a pair with polynomials; the second follows it.
blend::PatchRecord& first_of_a_pair(BlendTable& table) {
  for (blend::PatchRecord& record : table.grids[0].records) {
    if (record.paired() && !record.listed()) return record;
  }
  throw std::logic_error("there is no pair");
}

struct Fault {
  const char* name;
  const char* says;
  std::function<void(BlendTable&)> make;
  const BlendTable& (*good)() = good_table;
};

class ValidateFinds : public testing::TestWithParam<Fault> {};

std::vector<Fault> faults() {
  return {
      {"PlacesCutShort", "not every pixel once", [](BlendTable& t) { t.grids[0].places.assign(64, 0); }},
      {"PlaceTwice", "not every pixel once",
       [](BlendTable& t) {
         blend::GridTable& grid = t.grids[0];
         grid.places.assign(grid.tile_count() * 64, blend::GridTable::kNowhere);
         for (int y = 0; y < grid.height; ++y) {
           for (int x = 0; x < grid.width; ++x) {
             grid.places[grid.tile_index(x / 8, y / 8) * 64 + static_cast<std::size_t>(y % 8 * 8 + x % 8)] =
                 blend::GridTable::place(x, y);
           }
         }
         ASSERT_TRUE(validate_blend_table(t).has_value());
         grid.places[1] = grid.places[0];
       }},
      {"PlaceOutside", "not every pixel once",
       [](BlendTable& t) {
         blend::GridTable& grid = t.grids[0];
         grid.places.assign(grid.tile_count() * 64, blend::GridTable::place(grid.width, 0));
       }},
      {"BatchesWithoutPlaces", "grid 0: it has batches but no places", [](BlendTable& t) { t.grids[0].places.clear(); },
       scattered_table},
      {"BatchesWithoutAnEnd", "not all of its tiles and runs", [](BlendTable& t) { t.grids[0].batches.pop_back(); },
       scattered_table},
      {"BatchesOfNothing", "not all of its tiles and runs", [](BlendTable& t) { t.grids[0].batches.clear(); },
       scattered_table},
      {"BatchesNotFromTheFirst", "not all of its tiles and runs",
       [](BlendTable& t) { t.grids[0].batches[0].strip = 1; }, scattered_table},
      {"BatchesThatFall", "batches are not in order", [](BlendTable& t) { t.grids[0].batches[1].strip = 0; },
       scattered_table},
      {"BatchPastTheLastTile", "batches are not in order",
       [](BlendTable& t) { t.grids[0].batches[1].strip = 1U << 31; }, scattered_table},
      {"BatchPastTheLastRun", "batches are not in order", [](BlendTable& t) { t.grids[0].batches[1].run = 1U << 31; },
       scattered_table},
      {"BatchTooLarge", "larger than its buffer",
       [](BlendTable& t) {
         ASSERT_GT(t.grids[0].batches.size(), 2U);
         t.grids[0].batches.erase(t.grids[0].batches.begin() + 1, t.grids[0].batches.end() - 1);
       },
       scattered_table},
      {"RunsNone", "not all of its tiles and runs", [](BlendTable& t) { t.grids[1].runs.clear(); }, scattered_table},
      {"RunsTooFew", "grid 1: its runs are not all of its pixels", [](BlendTable& t) { t.grids[1].slots.pop_back(); },
       scattered_table},
      {"RunsThatFall", "runs are not in order", [](BlendTable& t) { t.grids[1].runs[1].slot = 0; }, scattered_table},
      {"RunPastTheLastPixel", "runs are not in order", [](BlendTable& t) { t.grids[1].runs[1].slot = 1U << 31; },
       scattered_table},
      {"RunElsewhere", "a pixel that is at another place", [](BlendTable& t) { t.grids[1].runs[0].place += 1; },
       scattered_table},
      {"RunOutsideTheGrid", "a pixel that is at another place",
       [](BlendTable& t) {
         // A run of one pixel that is outside the grid: its place is the same number.
         blend::GridTable& grid = t.grids[1];
         const auto outside = std::ranges::find(grid.places, blend::GridTable::kNowhere);
         ASSERT_NE(outside, grid.places.end());
         const auto p = static_cast<std::size_t>(outside - grid.places.begin());
         grid.slots[0] = static_cast<std::uint16_t>(blend::GridTable::slot(p / 512, p % 512 / 64, p % 64, 2));
         grid.runs.insert(grid.runs.begin(), {blend::GridTable::kNowhere, 0});
         grid.runs[1].place += 1;
         grid.runs[1].slot = 1;
         for (std::size_t b = 1; b < grid.batches.size(); ++b) ++grid.batches[b].run;
       },
       scattered_table},
      {"SlotOfAnotherComponent", "not in its batch", [](BlendTable& t) { t.grids[1].slots[0] += 512; },
       scattered_table},
      {"SlotPastItsBatch", "not in its batch",
       [](BlendTable& t) {
         const std::size_t run = t.grids[0].batches.rbegin()[1].run;
         t.grids[0].slots[t.grids[0].runs[run].slot] = 65535;
       },
       scattered_table},
      {"SlotTwice", "a pixel is in two runs",
       [](BlendTable& t) {
         blend::GridTable& grid = t.grids[1];
         ASSERT_EQ(grid.runs[1].slot - grid.runs[0].slot, grid.runs[2].slot - grid.runs[1].slot);
         grid.runs[1].place = grid.runs[0].place;
         std::copy_n(grid.slots.begin(), grid.runs[1].slot, grid.slots.begin() + grid.runs[1].slot);
       },
       scattered_table},
      {"NoHeads", "0 heads", [](BlendTable& t) { t.sources.clear(); }},
      {"TooManyHeads", "17 heads", [](BlendTable& t) { t.sources.resize(17, t.sources[0]); }},
      {"HeadOfAnotherKind", "head 1", [](BlendTable& t) { t.sources[1].format = PixelFormat::kRgb24; }},
      {"HeadGain", "head 2: gain 40000", [](BlendTable& t) { t.sources[2].gain[1] = 40000; }},
      {"Sharpening", "head 0: sharpening 17", [](BlendTable& t) { t.sources[0].sharpen = 17; }},
      {"RaymapFormat", "raymap format YUYV", [](BlendTable& t) { t.format = PixelFormat::kYuyv; }},
      {"LinearLightInEightBits", "numbers of linear light",
       [](BlendTable& t) { t.linear.resize(blend::kLinearSteps); }},
      {"RaymapOfNothing", "raymap of 0 x 20", [](BlendTable& t) { t.width = 0; }},
      {"CoverMissing", "1 covers for 2 grids", [](BlendTable& t) { t.cover.assign(1, t.grids[0]); }},
      {"CoverOfAnotherSize", "cover 1 does not have", [](BlendTable& t) { t.cover.assign(2, t.grids[0]); }},
      {"CoverWithPlaces", "cover 0 has places",
       [](BlendTable& t) {
         t.cover = t.grids;
         t.cover[0].places.assign(64, 0);
       }},
      {"CoverWithoutGains", "cover 1: gains",
       [](BlendTable& t) {
         t.cover = t.grids;
         t.cover[1].gains.clear();
       }},
      {"CoverNamesAHeadNotThere", "cover 0, tile (0, 0): names a head",
       [](BlendTable& t) {
         t.cover = t.grids;
         ASSERT_TRUE(validate_blend_table(t).has_value());
         t.cover[0].records[0].source |= 5;
       }},
      {"GridMissing", "1 grids", [](BlendTable& t) { t.grids.pop_back(); }},
      {"GridOfAnotherSize", "grid 1", [](BlendTable& t) { t.grids[1].width = 19; }},
      {"GridStep", "grid 1", [](BlendTable& t) { t.grids[1].row_step = 1; }},
      {"ComponentOnTheWrongGrid", "component 2", [](BlendTable& t) { t.components[2].grid = 0; }},
      {"ToneClass", "component 0", [](BlendTable& t) { t.components[0].tone = 3; }},
      {"NoLevels", "head 3: 0 levels", [](BlendTable& t) { t.sources[3].levels = 0; }},
      {"VignettingScale", "vignetting scale 255", [](BlendTable& t) { t.vignetting_scale = 255; }},
      {"TilesTooFew", "grid 0: there is not", [](BlendTable& t) { t.grids[0].tiles.pop_back(); }},
      {"TilesNotFromZero", "begin with the first", [](BlendTable& t) { t.grids[0].tiles[0].record = 1; }},
      {"TilesPastTheEnd", "last record", [](BlendTable& t) { t.grids[1].tiles.back().record += 1; }},
      {"TilesFall", "grid 0, tile (1, 0): its records fall", [](BlendTable& t) { t.grids[0].tiles[2].record = 0; }},
      {"GainsTooFew", "one gain a record", [](BlendTable& t) { t.grids[0].gains.pop_back(); }},
      {"ListCutShort", "cut short", [](BlendTable& t) { t.grids[0].coordinates.resize(127); }},
      {"WeightsRunAway", "weights run past", [](BlendTable& t) { t.grids[0].tiles[0].sharing |= 0x3fffffff; }},
      {"WeightsOfTheLastRecordRunAway", "weights run past",
       [](BlendTable& t) {
         const std::size_t all = t.grids[0].weights.size();
         const auto [tile, own] = widely_shared_tile(t);
         ASSERT_EQ((all - own) % 4, 0U);
         tile->sharing = (tile->sharing & 0xc0000000) | static_cast<std::uint32_t>((all - own) / 4 + 1);
       }},
      {"SeveralAlone", "are alone", [](BlendTable& t) { shared_tile(t).sharing = 0; }},
      {"HeadNotThere", "names a head", [](BlendTable& t) { t.grids[0].records[0].source |= 5; }},
      {"LevelNotThere", "names a level", [](BlendTable& t) { t.grids[0].records[0].source |= 3 << 4; }},
      {"PatchRightOfThePicture", "patch outside", [](BlendTable& t) { t.grids[0].records[0].left = 9; }},
      {"PatchBelowThePicture", "patch outside", [](BlendTable& t) { t.grids[1].records[0].top = 65535; }},
      {"RowsBeyond", "rows beyond", [](BlendTable& t) { t.grids[0].records[0].rows = 15 | 6 << 4; }},
      {"SpanTooShort", "rows beyond", [](BlendTable& t) { t.grids[0].records[0].rows = 14 | 5 << 4; }},
      {"SpanBeyond", "rows beyond",
       [](BlendTable& t) {
         t.grids[0].records[0].rows = 14 | 6 << 4;
         t.grids[0].records[0].first[1] = 10 << 4;
       }},
      {"RowAboveTheFirst", "does not name",
       [](BlendTable& t) {
         plain_record(t).rows = 14 | 6 << 4;
         plain_record(t).first = {0x99, 0x99};
       }},
      {"RowBelowTheLast", "does not name",
       [](BlendTable& t) {
         plain_record(t).rows = 0 | 15 << 4;
         plain_record(t).first = {};
       }},
      {"BlackOfItsOwn", "rule of component 1", [](BlendTable& t) { t.components[2].black = 127; }},
      {"ListNotThere", "names a list",
       [](BlendTable& t) {
         t.grids[0].records[0].source |= blend::PatchRecord::kListed;
         t.grids[0].records[0].x[1] = 77;
       }},
      {"PixelAtThePatchsEdge", "patch's edge", [](BlendTable& t) { plain_record(t).x = {-1, 0, 0, 0, 0, 0}; }},
      {"NegativeWeight", "less than nothing", [](BlendTable& t) { t.grids[0].weights[shared_tile(t).weights()] = 1; }},
      {"NoGain", "gain out of range",
       [](BlendTable& t) {
         t.grids[0].gains[0] = {0, 0, 0, 0};
       }},
  };
}

std::vector<Fault> pair_faults() {
  const auto second = [](BlendTable& t) -> blend::PatchRecord& { return *(&first_of_a_pair(t) + 1); };
  std::vector<Fault> faults{
      {"UpperHalfAlone", "half a pair", [=](BlendTable& t) { second(t).first[0] = 0; }},
      {"LowerHalfAlone", "half a pair", [](BlendTable& t) { first_of_a_pair(t).first[1] = 0; }},
      {"NeitherHalf", "half a pair", [](BlendTable& t) { first_of_a_pair(t).first[0] = 0xff; }},
      {"TwoUpperHalves", "half a pair",
       [=](BlendTable& t) {
         second(t).first = {0, 0xff};
       }},
      {"PairCutByTheTile", "half a pair",
       [](BlendTable& t) {
         const auto upper = static_cast<std::uint32_t>(&first_of_a_pair(t) - t.grids[0].records.data());
         for (blend::Tile& tile : t.grids[0].tiles) {
           if (tile.record > upper) return static_cast<void>(tile.record = upper + 1);
         }
       }},
      {"PairOfTwoHeads", "do not match", [=](BlendTable& t) { second(t).source ^= 1; }},
      {"PairWithAnotherPolynomial", "do not match", [=](BlendTable& t) { second(t).y[1] += 1; }},
      {"PairWhosePatchHasMoved", "do not match", [=](BlendTable& t) { second(t).left += 1; }},
      {"PairWithOneList", "do not match", [=](BlendTable& t) { second(t).source |= blend::PatchRecord::kListed; }},
      {"RowsOfTheLowerHalf", "rows beyond", [=](BlendTable& t) { second(t).first[1] = 0xaa; }},
      {"RowsOfTheUpperHalf", "does not name", [](BlendTable& t) { first_of_a_pair(t).rows &= 0xf0; }},
      {"PixelOfTheLowerHalfAtTheEdge", "patch's edge",
       [=](BlendTable& t) {
         // Rows 0 .. 3 lie at samples 0 .. 6.7, row 7 at 15.7.
         first_of_a_pair(t).x = second(t).x = {0, 0, 9200, 0, 0, 0};
         first_of_a_pair(t).left = second(t).left = 0;
       }},
  };
  for (Fault& fault : faults) fault.good = paired_table;
  return faults;
}

TEST_P(ValidateFinds, TheFaultAndSaysWhereItIs) {
  ASSERT_TRUE(validate_blend_table(GetParam().good()));
  BlendTable table = GetParam().good();
  GetParam().make(table);
  const Status proven = validate_blend_table(table);
  ASSERT_FALSE(proven);
  EXPECT_EQ(proven.error().code, Errc::kTableInvalid);
  EXPECT_NE(proven.error().message.find(GetParam().says), std::string::npos) << proven.error().text();
}

INSTANTIATE_TEST_SUITE_P(Planted, ValidateFinds, testing::ValuesIn(faults()),
                         [](const auto& test) { return std::string(test.param.name); });

INSTANTIATE_TEST_SUITE_P(PlantedInPairs, ValidateFinds, testing::ValuesIn(pair_faults()),
                         [](const auto& test) { return std::string(test.param.name); });

const BlendTable& two_band_table() {
  static const BlendTable table = [] {
    Calibration rig = test::cube_rig(480);
    for (HeadCalibration& head : rig.heads) head.vignetting.coefficients = {-0.1, 0, 0};
    TableOptions options;
    options.transition = Transition::kTwoBand;
    options.cover = false;
    return compile_blend_table(rig, {"equirectangular", 512, 256, PixelFormat::kI420},
                               std::vector(6, PixelFormat::kYuyv), options)
        .value();
  }();
  return table;
}

/// The first point of the chroma grid that two heads see.
std::size_t shared_point(const BlendTable& table) {
  const std::vector<std::uint32_t>& first = table.grids[1].low.first_sight;
  for (std::size_t p = 0; p + 1 < first.size(); ++p) {
    if (first[p + 1] - first[p] > 1) return p;
  }
  throw std::logic_error("no point is shared");
}

blend::LowSight& shared_sight(BlendTable& table) {
  return table.grids[1].low.sights[table.grids[1].low.first_sight[shared_point(table)]];
}

std::vector<Fault> low_faults() {
  std::vector<Fault> faults{
      {"SquaresOfNoPowerOfTwo", "squares of 24", [](BlendTable& t) { t.sources[2].low_size = 24; }},
      {"SquaresTooSmall", "squares of 8", [](BlendTable& t) { t.sources[2].low_size = 8; }},
      {"SquaresTooLarge", "squares of 512", [](BlendTable& t) { t.sources[2].low_size = 512; }},
      {"OneGridOnly", "grid 1 is missing", [](BlendTable& t) { t.grids[1].low = {}; }},
      {"CellsOfThreeTiles", "cells of 3", [](BlendTable& t) { t.grids[0].low.cell_tiles = 3; }},
      {"CellsOfOtherTiles", "one entry a cell", [](BlendTable& t) { t.grids[0].low.cell_tiles = 1; }},
      {"CellsTooFew", "one entry a cell", [](BlendTable& t) { t.grids[0].low.cells.pop_back(); }},
      {"CellNamesNoPoint", "cell 3: names a point", [](BlendTable& t) { t.grids[0].low.cells[3][2] = 200; }},
      {"BlocksTooFew", "points of blocks", [](BlendTable& t) { t.grids[0].low.first_point.pop_back(); }},
      {"BlocksFall", "points of blocks", [](BlendTable& t) { t.grids[0].low.first_point[1] = 1000; }},
      {"TooManyPoints", "points of blocks",
       [](BlendTable& t) {
         blend::LowGrid& low = t.grids[0].low;
         low.first_point.back() += 200;
         low.first_sight.insert(low.first_sight.end(), 200, low.first_sight.back());
       }},
      {"PointsNotFromZero", "sights of points", [](BlendTable& t) { t.grids[0].low.first_sight[0] = 1; }},
      {"SightsPastTheEnd", "sights of points", [](BlendTable& t) { t.grids[0].low.first_sight.back() += 1; }},
      {"HeadOfASightNotThere", "names a head that is not there", [](BlendTable& t) { shared_sight(t).head = 6; }},
      {"HeadTwice", "names a head twice", [](BlendTable& t) { (&shared_sight(t) + 1)->head = shared_sight(t).head; }},
      {"HeadWithoutLowPicture", "has no low picture",
       [](BlendTable& t) { t.sources[shared_sight(t).head].low_size = 0; }},
      {"RightOfTheLowPicture", "outside its head's low picture",
       [](BlendTable& t) { shared_sight(t).x = 14 * 256 + 1; }},
      {"BelowTheLowPicture", "outside its head's low picture", [](BlendTable& t) { shared_sight(t).y = 65535; }},
      {"JustBelowTheLowPicture", "outside its head's low picture",
       [](BlendTable& t) {
         shared_sight(t).y = 14 * 256;  // the last of 15 rows
         ASSERT_TRUE(validate_blend_table(t).has_value());
         shared_sight(t).y = 14 * 256 + 1;
       }},
      {"WeightsTooSmall", "do not sum to one", [](BlendTable& t) { shared_sight(t).weight -= 1; }},
      {"NoGainOfASight", "gain out of range", [](BlendTable& t) { shared_sight(t).gain = 0; }},
  };
  for (Fault& fault : faults) fault.good = two_band_table;
  return faults;
}

INSTANTIATE_TEST_SUITE_P(PlantedInTheLowBand, ValidateFinds, testing::ValuesIn(low_faults()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(ValidateLinear, NumbersThatLightCouldMissOrBlackThatIsNone_AreRefused) {
  const Calibration rig = test::cube_rig(32);
  const std::vector<PixelFormat> formats(6, PixelFormat::kGrey8);
  const BlendTable good = compile_blend_table(rig, {"equirectangular", 40, 20, PixelFormat::kGrey16}, formats).value();
  const auto refused = [&](auto fault) {
    BlendTable table = good;
    fault(table.linear);
    const Status status = validate_blend_table(table);
    return !status && status.error().message.find("numbers of linear light") != std::string::npos;
  };
  EXPECT_TRUE(validate_blend_table(good));
  EXPECT_TRUE(refused([](auto& linear) { linear.pop_back(); }));
  EXPECT_TRUE(refused([](auto& linear) { linear.clear(); }));
  EXPECT_TRUE(refused([](auto& linear) { linear[0] = 1; }));
  EXPECT_TRUE(refused([](auto& linear) { std::swap(linear[100], linear[30'000]); }));
}

}  // namespace
}  // namespace nodal::table
