// Where the pixels of a patch read: to the last sample of a picture and of the patch, and no further.
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "rigs.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/validate.h"

namespace nodal::table {
namespace {

using blend::BlendTable;

std::string fault_in(const BlendTable& table) {
  const Status proven = validate_blend_table(table);
  return proven ? "" : proven.error().message;
}

TEST(ValidatePatches, PatchInAPictureThatIsSmaller_MayReadItsLastSamplesButNoneBeyond) {
  // Chroma of 12 x 12 samples: a pixel between the samples 10 and 11 is the last one.
  TableOptions options;
  options.transition = Transition::kFeather;
  BlendTable table = compile_blend_table(test::cube_rig(24), {"equirectangular", 40, 20, PixelFormat::kI420},
                                         std::vector(6, PixelFormat::kI420), options)
                         .value();
  blend::PatchRecord& record = table.grids[1].records.front();
  record.source = blend::PatchRecord::source_of(record.head(), 0, false);
  record.left = record.top = 6;
  record.rows = 14 | 15 << 4;
  record.first = {};
  const auto at = [](int sample) {
    return blend::Quadratic{static_cast<std::int16_t>(sample << blend::kFractionBits), 0, 0, 0, 0, 0};
  };
  record.x = record.y = at(4);
  EXPECT_EQ(fault_in(table), "");
  record.x = at(5);
  EXPECT_NE(fault_in(table).find("reads outside its head's picture"), std::string::npos) << fault_in(table);
  record.x = at(4);
  record.y = at(5);
  EXPECT_NE(fault_in(table).find("reads outside its head's picture"), std::string::npos) << fault_in(table);
}

TEST(ValidatePatches, PolynomialThatLeavesItsPatchInTheLastPixel_IsRefusedForEachOfItsTerms) {
  const BlendTable good =
      compile_blend_table(test::turned_fisheyes({0}), {"equirectangular", 960, 480, PixelFormat::kGrey8},
                          std::vector(1, PixelFormat::kGrey8))
          .value();
  const std::size_t first = good.grids[0].tiles[good.grids[0].tile_index(960 / 16, 480 / 16)].record;
  // The terms of pixel (7, 7): 1, i, j, ij, ii, jj. A coordinate of 14 is inside the patch, 15 is not.
  const std::array<int, 6> terms{1, 7, 7, 49, 49, 49};
  for (std::size_t k = 1; k < terms.size(); ++k) {
    for (blend::Quadratic blend::PatchRecord::*way : {&blend::PatchRecord::x, &blend::PatchRecord::y}) {
      BlendTable table = good;
      blend::PatchRecord& record = table.grids[0].records[first];
      ASSERT_FALSE(record.listed() || record.paired());
      record.left = record.top = 0;
      record.rows = 14 | 15 << 4;
      record.first = {};
      record.x = record.y = {};
      (record.*way)[k] = static_cast<std::int16_t>((14 * 4096 + 4095) / terms[k]);
      EXPECT_EQ(fault_in(table), "") << k;
      (record.*way)[k] = static_cast<std::int16_t>(15 * 4096 / terms[k] + 1);
      EXPECT_NE(fault_in(table).find("has a pixel at its patch's edge"), std::string::npos) << k << fault_in(table);
    }
  }
}

}  // namespace
}  // namespace nodal::table
