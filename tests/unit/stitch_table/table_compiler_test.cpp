#include "stitch/table/table_compiler.h"

#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "rigs.h"
#include "stitch/blend/blend.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::table {
namespace {

using test::cube_rig;

void expect_equal(const std::vector<blend::GridTable>& a, const std::vector<blend::GridTable>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t g = 0; g < a.size(); ++g) {
    EXPECT_EQ(a[g].tiles, b[g].tiles);
    EXPECT_EQ(a[g].records, b[g].records);
    EXPECT_EQ(a[g].weights, b[g].weights);
    EXPECT_EQ(a[g].coordinates, b[g].coordinates);
    EXPECT_EQ(a[g].gains, b[g].gains);
    EXPECT_EQ(a[g].low.cells, b[g].low.cells);
    EXPECT_EQ(a[g].low.first_point, b[g].low.first_point);
    EXPECT_EQ(a[g].low.first_sight, b[g].low.first_sight);
    EXPECT_EQ(a[g].low.sights, b[g].low.sights);
  }
}

TEST(TableCompiler, AnyPartitionOnAnyThreads_GivesTheSameTable) {
  const Calibration rig = cube_rig(160);
  const RaymapSpec spec{"equirectangular", 264, 132, PixelFormat::kI420};
  const std::vector<PixelFormat> formats(6, PixelFormat::kYuyv);
  const Result<blend::BlendTable> whole = compile_blend_table(rig, spec, formats);
  ASSERT_TRUE(whole) << whole.error().text();

  Result<TableCompiler> compiler = TableCompiler::make(rig, spec, formats);
  ASSERT_TRUE(compiler);
  ASSERT_EQ(compiler->row_count(), 2 * (17 + 9));  // rows of tiles; with two bands there is a cover
  {
    std::vector<std::jthread> threads;
    for (const auto& [begin, end] :
         {std::pair{8, 30}, std::pair{0, 3}, std::pair{3, 4}, std::pair{4, 8}, std::pair{41, 52}, std::pair{30, 41}}) {
      threads.emplace_back([&compiler, begin = begin, end = end] { compiler->compile_rows(begin, end); });
    }
  }
  const Result<blend::BlendTable> pieces = std::move(*compiler).finish();
  ASSERT_TRUE(pieces) << pieces.error().text();
  expect_equal(whole->grids, pieces->grids);
  expect_equal(whole->cover, pieces->cover);
  EXPECT_FALSE(whole->grids[0].low.sights.empty());
}

TEST(TableCompiler, MixtureOfYuvHeads_IsCompiledEachInItsOwnGrid) {
  const std::vector<PixelFormat> formats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                         PixelFormat::kUyvy, PixelFormat::kI420, PixelFormat::kYuyv};
  TableOptions options;
  options.transition = Transition::kFeather;  // uses pictures up to their edges
  const Result<blend::BlendTable> table =
      compile_blend_table(cube_rig(48), {"cube", 48, 32, PixelFormat::kI420}, formats, options);
  ASSERT_TRUE(table) << table.error().text();
  ASSERT_EQ(table->grids.size(), 2U);
  EXPECT_EQ(table->grids[1].width, 24);
  EXPECT_EQ(table->grids[1].height, 16);
  int lowest = 0;
  for (const blend::PatchRecord& record : table->grids[1].records) {
    lowest = std::max(lowest, record.top + record.last_row() + 1);
  }
  EXPECT_EQ(lowest, 23);  // the last of 24 rows: YUYV and UYVY have 48, and every second one is read
}

TEST(TableCompiler, MasksThatHideEverything_AreNamedWithTheirSolidAngle) {
  Calibration rig = cube_rig(48);
  for (HeadCalibration& head : rig.heads) head.region.masks = {{{-1, -1}, {49, -1}, {49, 49}, {-1, 49}}};
  const auto table =
      compile_blend_table(rig, {"equirectangular", 64, 32, PixelFormat::kGrey8}, std::vector(6, PixelFormat::kGrey8));
  ASSERT_FALSE(table);
  EXPECT_EQ(table.error().code, Errc::kNoCoverage);
  EXPECT_NE(table.error().message.find("the masks of head 'c3' leave a hole"), std::string::npos)
      << table.error().text();
  rig.heads[2].region.masks.clear();
  EXPECT_TRUE(
      compile_blend_table(rig, {"equirectangular", 64, 32, PixelFormat::kGrey8}, std::vector(6, PixelFormat::kGrey8)));
}

TEST(TableCompiler, GapBetweenHeads_IsCoveredByNobody) {
  Calibration rig = cube_rig(48);
  rig.heads.resize(1);
  const auto layout = geometry::make_layout("equirectangular", 64, 32).value();
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};
  const Result<blend::BlendTable> table = compile_blend_table(rig, *layout, PixelFormat::kGrey8, formats);
  ASSERT_TRUE(table) << table.error().text();
  std::vector<std::uint8_t> validity(64 * 32);
  const std::vector<std::uint8_t> picture(48 * 48);
  blend::validity_rows(*table, std::vector{packed_image(PixelFormat::kGrey8, 48, 48, picture.data())},
                       {validity.data(), 64, 32, 64, 1}, 0, 32);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const geometry::Ray ray = layout->ray(x + 0.5, y + 0.5).value();
      const bool ahead = ray.z() > 0 && std::max(std::abs(ray.x()), std::abs(ray.y())) / ray.z() < 1.327;
      EXPECT_EQ(validity[static_cast<std::size_t>(y * 64 + x)], ahead ? 255 : 0) << x << ", " << y;
    }
  }
}

struct Refused {
  const char* name;
  Errc code;
  const char* says;
  Calibration rig;
  RaymapSpec spec;
  std::vector<PixelFormat> formats;
};

class TableCompilerRefuses : public testing::TestWithParam<Refused> {};

std::vector<Refused> refused() {
  using enum PixelFormat;
  const RaymapSpec yuv{"equirectangular", 64, 32, kI420};
  const RaymapSpec rgb{"equirectangular", 64, 32, kRgb24};
  Calibration blind = cube_rig(48);
  blind.heads.resize(1);
  blind.heads[0].region = {0, 0, 0.01, 0.01, std::nullopt};
  Calibration tiny = cube_rig(3);
  Calibration flipped = cube_rig(48);
  flipped.heads[4].R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, -1};
  const RaymapSpec yuyv{"equirectangular", 64, 32, kYuyv};
  const RaymapSpec gnomonic{"gnomonic", 64, 32, kRgb24};
  const auto but_one = [](PixelFormat most, std::size_t odd, PixelFormat other) {
    std::vector<PixelFormat> formats(6, most);
    formats[odd] = other;
    return formats;
  };
  const std::vector<PixelFormat> all_rgb(6, kRgb24);
  std::vector<Refused> list;
  const auto add = [&](const char* name, Errc code, const char* says, const Calibration& rig, const RaymapSpec& spec,
                       const std::vector<PixelFormat>& formats) {
    list.push_back({name, code, says, rig, spec, formats});
  };
  const Calibration cube = cube_rig(48);
  add("TooFewHeads", Errc::kHeadMismatch, "6 heads, but the rig has 5", cube, yuv, std::vector(5, kI420));
  add("RgbAmongYuv", Errc::kUnsupported, "head 'c3'", cube, yuv, but_one(kI420, 3, kRgb24));
  add("MjpegUndecoded", Errc::kUnsupported, "decode MJPEG and Bayer pictures first", cube, yuv,
      but_one(kNv12, 0, kMjpeg));
  add("GreyIntoRgb", Errc::kUnsupported, "GREY", cube, rgb, but_one(kRgb24, 5, kGrey8));
  add("RaymapInYuyv", Errc::kUnsupported, "YUYV", cube, yuyv, std::vector(6, kYuyv));
  add("UnknownLayout", Errc::kUnsupported, "gnomonic", cube, gnomonic, all_rgb);
  add("NobodyLooks", Errc::kNoCoverage, "no head sees", blind, rgb, {kRgb24});
  add("HeadTooSmall", Errc::kBadValue, "head 'c0'", tiny, rgb, all_rgb);
  add("Reflection", Errc::kNotARotation, "c4", flipped, rgb, all_rgb);
  return list;
}

TEST_P(TableCompilerRefuses, WithOneErrorThatNamesTheTrouble) {
  const Refused& bad = GetParam();
  const Result<blend::BlendTable> table = compile_blend_table(bad.rig, bad.spec, bad.formats);
  ASSERT_FALSE(table);
  EXPECT_EQ(errc_name(table.error().code), errc_name(bad.code)) << table.error().text();
  EXPECT_NE(table.error().message.find(bad.says), std::string::npos) << table.error().text();
}

INSTANTIATE_TEST_SUITE_P(What, TableCompilerRefuses, testing::ValuesIn(refused()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace nodal::table
