// A blend table with random changes: tables that pass validation are blended by every kernel, from and into memory
// of exactly the pictures' size, so that a sanitizer detects one byte too far. All kernels must give the same
// result. The input is the number of the table, then steps of 8 bytes: the number's kind and grid, its index, its
// new value.
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/blend/blend.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/validate.h"
#include "tests/reference/prepared_heads.h"

namespace {

using namespace nodal;
using blend::BlendTable;
using blend::GridTable;

/// A head that looks along an axis, with a field of 90 x 90 degrees.
HeadCalibration square_head(int side, const std::array<double, 9>& rotation) {
  HeadCalibration head;
  head.name = "head";
  head.width = head.height = side;
  head.center_x = head.center_y = side / 2.0;
  head.lens = RectilinearLens{{side / 2.2}};
  head.region = {0, 0, static_cast<double>(side), static_cast<double>(side), {}};
  head.vignetting = {side / 2.0, side / 2.0, side / 2.0, {-0.1, 0, 0}};
  head.R_head_rig = rotation;
  return head;
}

/// Heads that look forward, right, back and left; none up or down.
Calibration ring(int side) {
  Calibration rig;
  rig.name = "ring";
  for (const auto& [c, s] : {std::pair{1, 0}, {0, 1}, {-1, 0}, {0, -1}}) {
    const double cosine = c, sine = s;
    rig.heads.push_back(square_head(side, {cosine, 0, -sine, 0, 1, 0, sine, 0, cosine}));
    rig.heads.back().name += std::to_string(rig.heads.size());
  }
  return rig;
}

BlendTable compiled(int side, const table::RaymapSpec& raymap, const std::vector<PixelFormat>& formats) {
  const Result<BlendTable> table = table::compile_blend_table(ring(side), raymap, formats);
  NODAL_ASSERT(table.has_value());
  return *table;
}

/// The table with a position for every pixel, as if the raymap were a list of rays.
BlendTable with_places(BlendTable table) {
  GridTable& grid = table.grids[0];
  grid.places.assign(grid.tile_count() * blend::kTilePixels, GridTable::kNowhere);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      grid.places[grid.tile_index(x / 8, y / 8) * 64 + static_cast<std::size_t>(y % 8 * 8 + x % 8)] =
          GridTable::place(x, y);
    }
  }
  return table;
}

const std::vector<BlendTable>& good_tables() {
  using enum PixelFormat;
  static const std::vector<BlendTable> tables{
      compiled(24, {"equirectangular", 40, 20, kI420}, {kI420, kNv12, kYuyv, kUyvy}),
      compiled(33, {"cube", 72, 48, kRgb24}, {kRgb24, kRgb24, kRgb24, kRgb24}),
      compiled(160, {"equirectangular", 72, 36, kGrey8}, {kGrey8, kGrey8, kGrey8, kGrey8}),  // uses smaller levels
      compiled(24, {"equirectangular", 40, 20, kRgb48}, {kRgb24, kRgb24, kRgb24, kRgb24}),
      with_places(compiled(24, {"equirectangular", 40, 20, kGrey8}, {kGrey8, kGrey8, kGrey8, kGrey8})),
      compiled(24, {"hammersley", 40, 20, kI420}, {kI420, kI420, kI420, kI420}),
      compiled(24, {"hammersley", 300, 90, kRgb24}, {kRgb24, kRgb24, kRgb24, kRgb24}),  // with several batches
  };
  return tables;
}

struct Step {
  std::uint8_t field;
  std::uint8_t grid;
  std::uint16_t place;
  std::uint32_t value;
};
static_assert(sizeof(Step) == 8);

void take(const Step& step, BlendTable& table) {
  GridTable& grid = table.grids[step.grid % table.grids.size()];
  BlendTable::Source& source = table.sources[step.place % table.sources.size()];
  const auto set = [&](auto& field) { field = static_cast<std::remove_reference_t<decltype(field)>>(step.value); };
  const auto set_one = [&](auto& list) {
    if (!list.empty()) set(list[step.place % list.size()]);
  };
  blend::PatchRecord none;
  blend::PatchRecord& record = grid.records.empty() ? none : grid.records[step.place % grid.records.size()];
  blend::Tile& tile = grid.tiles[step.place % grid.tiles.size()];
  switch (step.field % 28) {
    case 0: set(tile.record); break;
    case 1: set(tile.sharing); break;
    case 2: set(record.left); break;
    case 3: set(record.top); break;
    case 4: set(record.source); break;
    case 5: set(record.rows); break;
    case 6: set(record.first[step.grid / 2 % 2]); break;
    case 7: set(record.x[step.grid / 2 % 6]); break;
    case 8: set(record.y[step.grid / 2 % 6]); break;
    case 9: set_one(grid.weights); break;
    case 10: set_one(grid.coordinates); break;
    case 11:
      if (!grid.gains.empty()) set(grid.gains[step.place % grid.gains.size()][step.grid / 2 % 4]);
      break;
    case 12: set_one(grid.places); break;
    case 13: grid.width = static_cast<int>(step.value % 256); break;
    case 14: grid.height = static_cast<int>(step.value % 256); break;
    case 15: set(grid.row_step); break;
    case 16: table.width = static_cast<int>(step.value % 256); break;
    case 17: table.height = static_cast<int>(step.value % 256); break;
    case 18: source.width = static_cast<int>(step.value % 256); break;
    case 19: source.height = static_cast<int>(step.value % 256); break;
    case 20: source.format = static_cast<PixelFormat>(1 + step.value % 7); break;
    case 21: source.levels = static_cast<std::uint8_t>(step.value); break;
    case 22: set(table.components[step.grid % table.components.size()].grid); break;
    case 23: set_one(table.linear); break;
    case 24:
      if (!grid.batches.empty()) {
        GridTable::Batch& batch = grid.batches[step.place % grid.batches.size()];
        set(step.grid / 2 % 2 == 0 ? batch.strip : batch.run);
      }
      break;
    case 25:
      if (!grid.runs.empty()) {
        GridTable::Run& run = grid.runs[step.place % grid.runs.size()];
        set(step.grid / 2 % 2 == 0 ? run.place : run.slot);
      }
      break;
    case 26: set_one(grid.slots); break;
    default: set(source.gain[step.grid % 3]); break;
  }
}

std::vector<std::uint8_t> picture_of(PixelFormat format, int width, int height) {
  std::vector<std::uint8_t> bytes(packed_size(format, width, height));
  std::uint32_t noise = 1;
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>((noise = noise * 1664525 + 1013904223) >> 24);
  return bytes;
}

void blend_by_all(const BlendTable& table) {
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<ImageView> heads;
  for (const BlendTable::Source& source : table.sources) {
    memory.push_back(picture_of(source.format, source.width, source.height));
    heads.push_back(packed_image(source.format, source.width, source.height, std::as_const(memory.back()).data()));
  }
  const test::PreparedHeads prepared(table, heads);
  std::vector<std::uint8_t> expected;
  for (const blend::Kernel kernel : blend::kernels()) {
    std::vector<std::uint8_t> raymap(packed_size(table.format, table.width, table.height));
    blend::blend_rows_by(kernel, table, prepared.views(), blend::calibrated_tone(table),
                         packed_image(table.format, table.width, table.height, raymap.data()), 0, table.height);
    if (kernel == blend::Kernel::kScalar) expected = raymap;
    NODAL_ASSERT(raymap == expected);
  }
  std::vector<std::uint8_t> validity(static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height));
  blend::validity_rows(table, heads, {validity.data(), table.width, table.height, table.width, 1}, 0, table.height);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  BlendTable table = good_tables()[data[0] % good_tables().size()];
  constexpr std::size_t kSteps = 16;
  for (std::size_t at = 1; at + sizeof(Step) <= size && at < kSteps * sizeof(Step); at += sizeof(Step)) {
    Step step;
    std::memcpy(&step, data + at, sizeof step);
    take(step, table);
  }
  if (const Status proven = table::validate_blend_table(table); !proven) {
    NODAL_ASSERT(!proven.error().message.empty());
    return 0;
  }
  blend_by_all(table);
  return 0;
}
