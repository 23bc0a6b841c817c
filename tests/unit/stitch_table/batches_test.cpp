// Scattered raymaps that are written in runs.
#include "stitch/table/batches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/table/table_compiler.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"

namespace nodal::table {
namespace {

struct Scattered {
  std::string layout;
  int width, height;
  PixelFormat format;
};

blend::BlendTable compiled(const Scattered& wanted, Transition transition = Transition::kTwoBand) {
  TableOptions options;
  options.transition = transition;
  const std::vector<PixelFormat> formats(6, in_8_bits(wanted.format));
  return compile_blend_table(test::cube_rig(256), {wanted.layout, wanted.width, wanted.height, wanted.format}, formats,
                             options)
      .value();
}

double mean_run(const blend::GridTable& grid) {
  return static_cast<double>(grid.slots.size()) / static_cast<double>(grid.runs.size() - 1);
}

class Batches : public testing::TestWithParam<Scattered> {};

/// The same table without batches writes each pixel on its own.
TEST_P(Batches, WrittenInRuns_AreTheSameBytes_WithEveryKernelAndInAnyRows) {
  const blend::BlendTable table = compiled(GetParam());
  blend::BlendTable one_by_one = table;
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    ASSERT_GT(table.grids[g].batches.size(), 2U) << "one batch would not show whether calls divide them";
    const blend::LowGrid& low = table.grids[g].low;
    ASSERT_GT(low.sights.size(), low.first_sight.size()) << "no head would be corrected";
    one_by_one.grids[g].batches.clear();
  }
  std::mt19937 random(2);
  std::vector<test::Picture> pictures;
  std::vector<ImageView> heads;
  for (int h = 0; h < 6; ++h) {
    test::Picture& picture = pictures.emplace_back(table.sources[0].format, 256, 256);
    for (std::uint8_t& byte : picture.bytes) byte = static_cast<std::uint8_t>(30 * h + random() % 50);
  }
  for (const test::Picture& picture : pictures) heads.push_back(picture.view());
  heads[2].planes[0].data = nullptr;
  const test::PreparedHeads prepared(table, heads);
  // Rows have 37 bytes more than their pixels.
  const auto in = [&](std::vector<std::uint8_t>& memory) {
    memory.assign(2 * packed_size(table.format, table.width, table.height), 77);
    MutableImageView raymap = packed_image(table.format, table.width, table.height, memory.data());
    std::uint8_t* at = memory.data();
    for (MutablePlaneView& plane : raymap.planes) {
      if (plane.data == nullptr) continue;
      const bool first_of_group = plane.pixel_stride == 1 || &plane == raymap.planes.data() ||
                                  (table.format == PixelFormat::kNv12 && &plane == &raymap.planes[1]);
      plane.row_stride += 37 - (is_linear16(table.format) ? 1 : 0);
      if (first_of_group) {
        plane.data = at;
        at += plane.row_stride * plane.height;
      } else {
        plane.data = (&plane)[-1].data + (is_linear16(table.format) ? 2 : 1);
      }
    }
    return raymap;
  };
  std::vector<std::uint8_t> expected, bytes;
  blend::blend_rows_by(blend::Kernel::kScalar, one_by_one, prepared.views(), blend::calibrated_tone(table),
                       in(expected), 0, table.height);
  for (const blend::Kernel kernel : blend::kernels()) {
    for (int split = 0; split < 4; ++split) {
      const MutableImageView raymap = in(bytes);
      for (int row = 0; row < table.height;) {
        const int rows = split == 0 ? table.height : 2 * static_cast<int>(1 + random() % 60);
        const int end = std::min(table.height, row + rows);
        blend::blend_rows_by(kernel, table, prepared.views(), blend::calibrated_tone(table), raymap, row, end);
        row = end;
      }
      ASSERT_TRUE(bytes == expected) << blend::kernel_name(kernel) << ", split " << split;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Batches,
                         testing::Values(Scattered{"hammersley", 701, 499, PixelFormat::kI420},
                                         Scattered{"hammersley", 640, 512, PixelFormat::kNv12},
                                         Scattered{"stratified_random", 701, 499, PixelFormat::kI420},
                                         Scattered{"stratified_random", 320, 256, PixelFormat::kRgb24},
                                         Scattered{"hammersley", 451, 333, PixelFormat::kGrey8},
                                         Scattered{"hammersley", 333, 222, PixelFormat::kRgb48},
                                         Scattered{"stratified_random", 333, 222, PixelFormat::kGrey16},
                                         Scattered{"halton", 1021, 515, PixelFormat::kI420},
                                         // Tiles below the last row: batches begin there.
                                         Scattered{"stratified_random", 4096, 66, PixelFormat::kI420}),
                         [](const auto& which) {
                           return which.param.layout + "_" + std::string(pixel_format_name(which.param.format)) + "_" +
                                  std::to_string(which.param.width);
                         });

TEST(BatchesOf, HammersleysRows_AreRuns) {
  const blend::BlendTable table = compiled({"hammersley", 1024, 512, PixelFormat::kGrey8}, Transition::kFeather);
  EXPECT_GE(table.grids[0].batches.size(), 1 + 1024 * 512 / blend::GridTable::kBufferSlots);
  // A batch is a band of 10.5 rows.
  EXPECT_GT(mean_run(table.grids[0]), 800);
}

TEST(BatchesOf, HaltonsCells_AreSideBySide) {
  const blend::BlendTable table = compiled({"halton", 1024, 512, PixelFormat::kGrey8}, Transition::kFeather);
  // A batch has 65536 / (1024 x 512 / 432) = 54 cells, and a pixel of each of them is in a run.
  EXPECT_GT(mean_run(table.grids[0]), 40);
}

TEST(BatchesOf, StripsOfStratifiedRays_HaveLongRuns) {
  const blend::BlendTable table = compiled({"stratified_random", 1024, 512, PixelFormat::kGrey8}, Transition::kFeather);
  EXPECT_GT(mean_run(table.grids[0]), 64);
}

TEST(BatchesOf, PixelsInNoOrder_HaveNone) {
  // Too few cells: strips of the whole sphere, of which each has pixels everywhere.
  const blend::BlendTable table = compiled({"halton", 400, 300, PixelFormat::kGrey8}, Transition::kFeather);
  EXPECT_FALSE(table.grids[0].places.empty());
  EXPECT_TRUE(table.grids[0].batches.empty());
  EXPECT_TRUE(table.grids[0].runs.empty());
  EXPECT_TRUE(table.grids[0].slots.empty());
}

}  // namespace
}  // namespace nodal::table
