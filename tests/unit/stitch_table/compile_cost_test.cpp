// The counted work of compiling: what makes it grow, and that only calibrations made to be expensive exceed the budget.
#include "stitch/table/compile_cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <sstream>

#include "rigs.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {
namespace {

constexpr std::uint64_t kPixels = 2048 * 1024;

CompileCost cost_of(const Calibration& rig, int width = 2048, int height = 1024) {
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kRgb24);
  const auto compiler = TableCompiler::make(rig, {"equirectangular", width, height, PixelFormat::kRgb24}, formats);
  EXPECT_TRUE(compiler) << compiler.error().text();
  return compiler ? compiler->cost() : CompileCost();
}

Status budget_of(const Calibration& rig) { return check_compile_budget(cost_of(rig), rig, kPixels); }

/// Sixteen thin masks of sixteen corners each along the diagonals, so that the box of each is nearly the whole picture.
void add_masks(HeadCalibration& head) {
  for (int m = 0; m < 16; ++m) {
    std::vector<Region::Point> mask;
    for (int k = 0; k < 8; ++k)
      mask.push_back({20.0 + m + k * (head.width - 60) / 7.0, 20 + k * (head.height - 60) / 7.0});
    for (int k = 7; k >= 0; --k) {
      mask.push_back({20.5 + m + k * (head.width - 60) / 7.0, 20.2 + k * (head.height - 60) / 7.0});
    }
    head.region.masks.push_back(std::move(mask));
  }
}

/// Heads that all see nearly the whole sphere.
Calibration crafted(int heads) {
  Calibration rig;
  for (int i = 0; i < heads; ++i) {
    rig.heads.push_back(
        test::head_at("c" + std::to_string(i), 1300, 1300, EquidistantLens{{300}}, {360.0 * i / heads, 0, 0}));
    add_masks(rig.heads.back());
  }
  return rig;
}

TEST(CompileCost, OfTwiceTheSidesOfARaymap_IsFourTimesTheWork) {
  const Calibration rig = test::cube_rig(600);
  const double ratio = static_cast<double>(cost_of(rig).total) / static_cast<double>(cost_of(rig, 1024, 512).total);
  EXPECT_NEAR(ratio, 4, 0.1);
}

TEST(CompileCost, MasksAndFieldsThatOverlap_MakeAHeadCostMore) {
  Calibration rig = test::cube_rig(600);
  const std::uint64_t plain = cost_of(rig).heads[2];
  add_masks(rig.heads[2]);
  const CompileCost masked = cost_of(rig);
  EXPECT_GT(masked.heads[2], 3 * plain);
  EXPECT_LT(masked.heads[1], plain * 3 / 2);
}

TEST(CompileBudget, RigsOfAnyShapeWithoutCraft_AreWithinIt) {
  EXPECT_TRUE(budget_of(test::cube_rig(600)));
  EXPECT_TRUE(budget_of(test::turned_fisheyes({0, 60, 120, 180, 240, 300})));
  std::mt19937 random(3);
  for (int i = 0; i < 30; ++i) {
    const Calibration rig = test::random_rig(random);
    const Status within = budget_of(rig);
    EXPECT_TRUE(within) << i << ": " << within.error().message;
  }
  std::ifstream file(NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json");
  std::stringstream text;
  text << file.rdbuf();
  const auto ten = parse_calibration(text.str());
  ASSERT_TRUE(ten);
  EXPECT_TRUE(budget_of(*ten));
  const CompileCost cost = cost_of(*ten);
  EXPECT_LT(cost.total * 4, compile_budget(kPixels, 10)) << "far within";
}

TEST(CompileBudget, TenHeadsThatSeeEverythingThroughAllMasksThereMayBe_AreRefusedNamingAHead) {
  Calibration rig = crafted(10);
  rig.heads[6].region.masks.push_back({{5, 5}, {1290, 5}, {1290, 1290}});
  rig.heads[6].region.masks.erase(rig.heads[6].region.masks.begin());
  const Status refused = budget_of(rig);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kTooLarge);
  EXPECT_NE(refused.error().message.find(" heads. Head 'c"), std::string::npos) << refused.error().message;
  for (std::size_t i = 0; i < rig.heads.size(); ++i) {
    if (i != 3) rig.heads[i].region.masks.resize(2);
  }
  const CompileCost cost = cost_of(rig);
  EXPECT_EQ(std::ranges::max_element(cost.heads) - cost.heads.begin(), 3) << "the one with masks costs most";
}

}  // namespace
}  // namespace nodal::table
