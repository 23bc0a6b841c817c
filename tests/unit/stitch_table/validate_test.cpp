#include "stitch/table/validate.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <random>
#include <stdexcept>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::table {
namespace {

using blend::BlendTable;

const BlendTable& good_table() {
  static const BlendTable table = [] {
    Calibration rig = test::cube_rig(24);
    rig.heads.pop_back();  // a hole
    for (HeadCalibration& head : rig.heads) head.vignetting.coefficients = {-0.1, 0, 0};
    const std::vector<PixelFormat> formats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                           PixelFormat::kUyvy, PixelFormat::kI420};
    return compile_blend_table(rig, {"equirectangular", 40, 20, PixelFormat::kI420}, formats).value();
  }();
  return table;
}

/// A tile of the first grid that several records share by lists or coefficients.
blend::Tile& shared_tile(BlendTable& table) {
  for (blend::Tile& tile : table.grids[0].tiles) {
    if (tile.how() != blend::Sharing::kAlone && (&tile + 1)->record > tile.record + 1) return tile;
  }
  throw std::logic_error("no tile is shared");
}

/// A record of the first grid with polynomials.
blend::PatchRecord& plain_record(BlendTable& table) {
  for (blend::PatchRecord& record : table.grids[0].records) {
    if (!record.listed()) return record;
  }
  throw std::logic_error("every record is listed");
}

struct Fault {
  const char* name;
  const char* says;
  std::function<void(BlendTable&)> make;
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
      {"NoHeads", "0 heads", [](BlendTable& t) { t.sources.clear(); }},
      {"TooManyHeads", "17 heads", [](BlendTable& t) { t.sources.resize(17, t.sources[0]); }},
      {"HeadOfAnotherKind", "head 1", [](BlendTable& t) { t.sources[1].format = PixelFormat::kRgb24; }},
      {"HeadGain", "head 2: gain 40000", [](BlendTable& t) { t.sources[2].gain[1] = 40000; }},
      {"Sharpening", "head 0: sharpening 17", [](BlendTable& t) { t.sources[0].sharpen = 17; }},
      {"RaymapFormat", "raymap format YUYV", [](BlendTable& t) { t.format = PixelFormat::kYuyv; }},
      {"LinearLightInEightBits", "numbers of linear light", [](BlendTable& t) { t.linear.resize(blend::kLinearSteps); }},
      {"RaymapOfNothing", "raymap of 0 x 20", [](BlendTable& t) { t.width = 0; }},
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
      {"SeveralAlone", "are alone", [](BlendTable& t) { shared_tile(t).sharing = 0; }},
      {"HeadNotThere", "names a head", [](BlendTable& t) { t.grids[0].records[0].source |= 5; }},
      {"LevelNotThere", "names a level", [](BlendTable& t) { t.grids[0].records[0].source |= 3 << 4; }},
      {"PatchRightOfThePicture", "patch outside", [](BlendTable& t) { t.grids[0].records[0].left = 9; }},
      {"PatchBelowThePicture", "patch outside", [](BlendTable& t) { t.grids[1].records[0].top = 65535; }},
      {"RowsBeyond", "rows beyond", [](BlendTable& t) { t.grids[0].records[0].rows = 15 | 6 << 4; }},
      {"SpanTooShort", "rows beyond", [](BlendTable& t) { t.grids[0].records[0].rows = 14 | 5 << 4; }},
      {"SpanBeyond", "rows beyond", [](BlendTable& t) {
         t.grids[0].records[0].rows = 14 | 6 << 4;
         t.grids[0].records[0].first[1] = 10 << 4;
       }},
      {"RowAboveTheFirst", "does not name", [](BlendTable& t) {
         plain_record(t).rows = 14 | 6 << 4;
         plain_record(t).first = {0x99, 0x99};
       }},
      {"RowBelowTheLast", "does not name", [](BlendTable& t) { plain_record(t).rows = 0 | 15 << 4; plain_record(t).first = {}; }},
      {"ListNotThere", "names a list", [](BlendTable& t) {
         t.grids[0].records[0].source |= blend::PatchRecord::kListed;
         t.grids[0].records[0].x[1] = 77;
       }},
      {"PixelAtThePatchsEdge", "patch's edge", [](BlendTable& t) { plain_record(t).x = {-1, 0, 0, 0, 0, 0}; }},
      {"NegativeWeight", "less than nothing", [](BlendTable& t) { t.grids[0].weights[shared_tile(t).weights()] = 1; }},
      {"NoGain", "gain out of range", [](BlendTable& t) { t.grids[0].gains[0] = {0, 0, 0, 0}; }},
  };
}

TEST_P(ValidateFinds, TheFaultAndSaysWhereItIs) {
  ASSERT_TRUE(validate_blend_table(good_table()));
  BlendTable table = good_table();
  GetParam().make(table);
  const Status proven = validate_blend_table(table);
  ASSERT_FALSE(proven);
  EXPECT_EQ(proven.error().code, Errc::kTableInvalid);
  EXPECT_NE(proven.error().message.find(GetParam().says), std::string::npos) << proven.error().text();
}

INSTANTIATE_TEST_SUITE_P(Planted, ValidateFinds, testing::ValuesIn(faults()),
                         [](const auto& test) { return std::string(test.param.name); });

/// Sets one number anywhere in the table to something telling.
void mutate(BlendTable& table, std::mt19937& random) {
  const auto pick = [&](auto& list) -> auto& { return list[random() % list.size()]; };
  const std::uint32_t values[] = {0, 1, 2, 3, 7, 8, 14, 15, 16, 4095, 4096, 32767, 32768, 65535, 1U << 31, ~0U};
  const std::uint32_t value = values[random() % 16];
  const auto set = [&](auto& field) { field = static_cast<std::remove_reference_t<decltype(field)>>(value); };
  blend::GridTable& grid = pick(table.grids);
  blend::PatchRecord& record = pick(grid.records);
  BlendTable::Source& source = pick(table.sources);
  switch (random() % 22) {
    case 0: set(pick(grid.tiles).record); break;
    case 1: set(grid.width); break;
    case 2: set(grid.height); break;
    case 3: set(grid.row_step); break;
    case 4: set(record.left); break;
    case 5: set(record.top); break;
    case 6: set(pick(record.x)); break;
    case 7: set(pick(record.y)); break;
    case 8: set(random() % 3 == 0 ? record.rows : pick(record.first)); break;
    case 9: set(record.source); break;
    case 10: set(source.width); break;
    case 11: source.format = static_cast<PixelFormat>(1 + value % 7); break;
    case 12: set(pick(table.components).grid); break;
    case 13: set(table.width); break;
    case 14: source.height = static_cast<int>(value % 64); break;
    case 15: record.source ^= static_cast<std::uint8_t>(1U << random() % 8); break;
    case 16: set(pick(grid.tiles).sharing); break;
    case 17: pick(grid.tiles).sharing ^= 1U << (random() % 32); break;
    case 18: if (!grid.weights.empty()) set(pick(grid.weights)); break;
    case 19: if (!grid.coordinates.empty()) set(pick(grid.coordinates)); break;
    case 20: set(pick(pick(grid.gains))); break;
    default: set(pick(source.gain)); break;
  }
}

/// Memory of exactly the size a picture has, on the heap: the address sanitizer sees one byte too far.
std::vector<std::uint8_t> exact_bytes(const BlendTable::Source& source) {
  return std::vector<std::uint8_t>(packed_size(source.format, source.width, source.height), 200);
}

RC_GTEST_PROP(ValidateBlendTable, AnyMutatedTable_IsRefusedOrRunsInBounds, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  BlendTable table = good_table();
  for (auto n = 1 + random() % 3; n > 0; --n) mutate(table, random);
  if (!validate_blend_table(table)) return;
  if (std::int64_t{table.width} * table.height > 1 << 20) return;
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<ImageView> heads;
  for (const BlendTable::Source& source : table.sources) {
    if (std::int64_t{source.width} * source.height > 1 << 22) return;
    memory.push_back(exact_bytes(source));
    heads.push_back(packed_image(source.format, source.width, source.height, std::as_const(memory.back()).data()));
  }
  std::vector<std::uint8_t> raymap(packed_size(table.format, table.width, table.height));
  const test::PreparedHeads prepared(table, heads);
  for (const blend::Kernel kernel : blend::kernels()) {
    blend::blend_rows_by(kernel, table, prepared.views(), blend::calibrated_tone(table),
                         packed_image(table.format, table.width, table.height, raymap.data()), 0, table.height);
  }
  std::vector<std::uint8_t> validity(static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height));
  blend::validity_rows(table, heads, {validity.data(), table.width, table.height, table.width, 1}, 0, table.height);
}

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
