#include "stitch/table/validate.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <random>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {
namespace {

using blend::BlendTable;

const BlendTable& good_table() {
  static const BlendTable table = [] {
    Calibration rig = test::cube_rig(16);
    rig.heads.pop_back();  // a hole, so that some samples have no taps
    const std::vector<PixelFormat> formats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                           PixelFormat::kUyvy, PixelFormat::kI420};
    return compile_blend_table(rig, {"equirectangular", 12, 6, PixelFormat::kI420}, formats).value();
  }();
  return table;
}

struct Fault {
  const char* name;
  const char* says;
  std::function<void(BlendTable&)> make;
};

class ValidateFinds : public testing::TestWithParam<Fault> {};

std::vector<Fault> faults() {
  return {
      {"NoHeads", "0 heads", [](BlendTable& t) { t.sources.clear(); }},
      {"TooManyHeads", "17 heads", [](BlendTable& t) { t.sources.resize(17, t.sources[0]); }},
      {"HeadOfAnotherKind", "head 1", [](BlendTable& t) { t.sources[1].format = PixelFormat::kRgb24; }},
      {"HeadGain", "head 2: gain 40000", [](BlendTable& t) { t.sources[2].gain[1] = 40000; }},
      {"Sharpening", "head 0: sharpening 17", [](BlendTable& t) { t.sources[0].sharpen = 17; }},
      {"RaymapFormat", "raymap format NV12", [](BlendTable& t) { t.format = PixelFormat::kNv12; }},
      {"RaymapOfNothing", "raymap of 0 x 6", [](BlendTable& t) { t.width = 0; }},
      {"GridMissing", "1 grids", [](BlendTable& t) { t.grids.pop_back(); }},
      {"GridOfAnotherSize", "grid 1", [](BlendTable& t) { t.grids[1].width = 7; }},
      {"GridStep", "grid 1", [](BlendTable& t) { t.grids[1].row_step = 1; }},
      {"ComponentOnTheWrongGrid", "component 2", [](BlendTable& t) { t.components[2].grid = 0; }},
      {"GainRow", "component 0", [](BlendTable& t) { t.components[0].gain_row = 3; }},
      {"FirstTooShort", "grid 0: first[]", [](BlendTable& t) { t.grids[0].first.pop_back(); }},
      {"FirstNotFromZero", "begin at 0", [](BlendTable& t) { t.grids[0].first[0] = 1; }},
      {"FirstPastTheEnd", "last tap", [](BlendTable& t) { t.grids[1].first.back() += 1; }},
      {"FirstFalls", "grid 0, sample (2, 1)", [](BlendTable& t) { t.grids[0].first[15] = 0; }},
      {"FirstRunsAway", "grid 0, sample (1, 0)", [](BlendTable& t) { t.grids[0].first[2] = 1U << 31; }},
      {"HeadNotThere", "tap 0: names a head", [](BlendTable& t) { t.grids[0].taps[0].head = 5; }},
      {"RightOfThePicture", "tap 0: reads outside", [](BlendTable& t) { t.grids[0].taps[0].x = 15; }},
      {"BelowThePicture", "reads outside", [](BlendTable& t) { t.grids[1].taps[0].y = 65535; }},
      {"FractionOfOne", "fraction", [](BlendTable& t) { t.grids[0].taps[0].fraction_y = 4096; }},
      {"NoWeight", "weight of nothing", [](BlendTable& t) { t.grids[0].taps[0].weight = 0; }},
      {"WeightsOff", "weights sum to", [](BlendTable& t) { t.grids[1].taps[0].weight -= 1; }},
      {"NoGain", "gain out of range", [](BlendTable& t) { t.grids[0].taps[0].gain = 0; }},
      {"Reserved", "reserved", [](BlendTable& t) { t.grids[0].taps[0].reserved = 1; }},
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
  blend::Tap& tap = pick(grid.taps);
  BlendTable::Source& source = pick(table.sources);
  switch (random() % 16) {
    case 0: set(pick(grid.first)); break;
    case 1: set(grid.width); break;
    case 2: set(grid.height); break;
    case 3: set(grid.row_step); break;
    case 4: set(tap.x); break;
    case 5: set(tap.y); break;
    case 6: set(tap.fraction_x); break;
    case 7: set(tap.weight); break;
    case 8: set(tap.gain); break;
    case 9: set(tap.head); break;
    case 10: set(source.width); break;
    case 11: source.format = static_cast<PixelFormat>(1 + value % 7); break;
    case 12: set(pick(table.components).grid); break;
    case 13: set(table.width); break;
    case 14: source.height = static_cast<int>(value % 64); break;
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
  blend::blend_rows(table, heads, packed_image(table.format, table.width, table.height, raymap.data()), 0,
                    table.height);
  std::vector<std::uint8_t> validity(static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height));
  blend::validity_rows(table, heads, {validity.data(), table.width, table.height, table.width, 1}, 0, table.height);
}

}  // namespace
}  // namespace nodal::table
