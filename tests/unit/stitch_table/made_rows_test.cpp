// Halved pictures: only the rows that a patch reads are made, and no other row is read.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <string>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/prepare.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/validate.h"
#include "tests/reference/png_file.h"

namespace nodal::test {
namespace {

/// What the blend makes of noise, with `memory` where pictures are prepared.
std::vector<std::uint8_t> blend_noise(const blend::BlendTable& table, std::uint8_t memory, bool confidence) {
  std::mt19937 random(3);
  std::vector<Picture> pictures;
  std::vector<std::vector<std::uint8_t>> prepared;
  std::vector<ImageView> views(table.sources.size() * blend::kMaxPictures), levels(blend::kMaxPictures);
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    const blend::BlendTable::Source& source = table.sources[h];
    Picture& picture = pictures.emplace_back(source.format, source.width, source.height);
    for (std::uint8_t& byte : picture.bytes) byte = static_cast<std::uint8_t>(random());
    prepared.emplace_back(blend::prepared_size(source), memory);
  }
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    blend::prepare_picture(table.sources[h], pictures[h].view(), prepared[h].data(), levels);
    for (std::size_t l = 0; l < table.sources[h].pictures(); ++l) views[l * table.sources.size() + h] = levels[l];
  }
  blend::SetTone tone = blend::calibrated_tone(table);
  if (confidence) {
    blend::Confidence by_level;
    for (auto& of_head : by_level.of_level) std::iota(of_head.begin(), of_head.end(), std::uint8_t{0});
    tone.confidence = by_level;
  }
  Picture raymap(table.format, table.width, table.height, 77);
  blend::blend_rows(table, views, tone, raymap.mutable_view(), 0, table.height);
  return raymap.bytes;
}

std::ptrdiff_t count(const std::vector<bool>& made) { return std::count(made.begin(), made.end(), true); }

struct Minified {
  const char* layout;
  int width, height, side;  ///< size of the raymap, and side of the heads' pictures
};

blend::BlendTable table_of(const Minified& what, PixelFormat raymap, PixelFormat head) {
  const std::vector<PixelFormat> formats(6, head);
  table::TableOptions options;
  options.transition = Transition::kSeam;  // with a cover
  return table::compile_blend_table(cube_rig(what.side), {what.layout, what.width, what.height, raymap}, formats,
                                    options)
      .value();
}

class MadeRows : public testing::TestWithParam<Minified> {};

TEST_P(MadeRows, AreAllThatTheBlendReads) {
  const std::pair<PixelFormat, PixelFormat> pairs[] = {{PixelFormat::kGrey8, PixelFormat::kGrey8},
                                                       {PixelFormat::kRgb24, PixelFormat::kRgb24},
                                                       {PixelFormat::kI420, PixelFormat::kI420},
                                                       {PixelFormat::kI420, PixelFormat::kUyvy}};
  for (const auto& [raymap, head] : pairs) {
    const blend::BlendTable table = table_of(GetParam(), raymap, head);
    blend::BlendTable whole = table;
    std::ptrdiff_t made = 0, all = 0;
    for (blend::BlendTable::Source& source : whole.sources) {
      for (const auto& of_grid : source.made) {
        for (const std::vector<bool>& bands : of_grid) made += count(bands), all += std::ssize(bands);
      }
      source.made = {};
    }
    EXPECT_GT(made, 0);
    EXPECT_LE(made, all);
    if (std::string(GetParam().layout) == "cylinder_equal_area" && raymap == PixelFormat::kGrey8) {
      EXPECT_LT(made, all) << "heads that look at the horizon are halved near the poles alone";
    }
    for (const bool confidence : {false, true}) {
      const std::vector<std::uint8_t> expected = blend_noise(whole, 0, confidence);
      EXPECT_EQ(blend_noise(table, 0, confidence), expected) << confidence;
      EXPECT_EQ(blend_noise(table, 255, confidence), expected) << confidence;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Layouts, MadeRows,
                         testing::Values(Minified{"equirectangular", 128, 64, 400},
                                         Minified{"cylinder_equal_area", 640, 200, 180},
                                         Minified{"sinusoidal", 256, 128, 90}, Minified{"hammer", 256, 128, 90}),
                         [](const auto& tested) { return std::string(tested.param.layout); });

TEST(RowsOfHalvedPictures, ConfidenceInChroma_HasTheLumaOfTheSameLevel) {
  const blend::BlendTable table =
      table_of({"cylinder_equal_area", 640, 200, 180}, PixelFormat::kI420, PixelFormat::kI420);
  int halved = 0;
  for (const blend::PatchRecord& record : table.grids[1].records) {
    if (record.pyramid_level() == 0) continue;
    ++halved;
    const auto level = static_cast<std::size_t>(record.pyramid_level());
    const std::vector<bool>& luma = table.sources[record.head()].made[0][level - 1];
    const int height = table.sources[record.head()].height >> level;
    for (int y = 2 * record.top; y < std::min(height, 2 * (record.top + blend::kPatch)); ++y) {
      ASSERT_TRUE(luma[static_cast<std::size_t>(y / blend::kMadeRows)]) << y;
    }
  }
  EXPECT_GT(halved, 0);
}

TEST(RowsOfHalvedPictures, OneBandThatIsReadLess_OrAnotherNumberOfBands_IsRefused) {
  blend::BlendTable table = table_of({"cylinder_equal_area", 640, 200, 180}, PixelFormat::kI420, PixelFormat::kI420);
  std::vector<bool>& bands = table.sources[2].made[1][0];
  ASSERT_GT(count(bands), 0);
  ASSERT_TRUE(table::validate_blend_table(table));
  *std::find(bands.begin(), bands.end(), true) = false;
  const Status missing = table::validate_blend_table(table);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("that is not made"), std::string::npos) << missing.error().text();
  bands.clear();  // all are made
  EXPECT_TRUE(table::validate_blend_table(table));
  bands.assign(1, true);
  EXPECT_FALSE(table::validate_blend_table(table));
}

}  // namespace
}  // namespace nodal::test
