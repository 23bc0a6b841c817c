// Placed seams between the blender and the seam stage: which sets are blended with which seams.
#include <gtest/gtest.h>

#include <algorithm>

#include "blender_fixture.h"
#include "firmware/picture/seam_stage.h"
#include "stitch/sets/blend_memory.h"
#include "stitch/sets/seam_views.h"

namespace nodal::firmware {
namespace {

/// Four heads with wide overlaps.
sets::BlendSetup with_placed_seams(std::uint8_t mark, double view_deg = 130) {
  Calibration calibration;
  calibration.name = "wide";
  for (int i = 0; i < kHeads; ++i) {
    calibration.heads.push_back(test::plain_head("cam" + std::to_string(i), kSide, kSide, 90.0 * i, view_deg));
  }
  RaymapConfig config = raymap_config();
  config.seams = SeamPlacement::kPlaced;
  const table::RaymapSpec spec{config.layout, config.width, config.height, config.format};
  std::vector<blend::BlendTable> tables;
  tables.push_back(
      table::compile_blend_table(calibration, spec, std::vector<PixelFormat>(kHeads, PixelFormat::kRgb24)).value());
  auto views = sets::SeamViews::make(calibration, config, tables).value();
  Sha256 id{};
  id.fill(mark);
  return sets::with_memory(sets::make_plan(id, calibration.name, std::move(tables), {}, {}, {}, std::move(views)));
}

class PlacedSeams : public BlenderTest {
 protected:
  /// Blends the set; the raymap.
  LineVector raymap_of(std::uint64_t number) {
    blend(full_set(number));
    const auto raymap = blender.raymaps_out().pop();
    EXPECT_TRUE(raymap);
    return raymap ? *raymap->pixels : LineVector{};
  }
  SeamStage stage{blender.seams().requests(), blender.seams().answers()};
};

TEST_F(PlacedSeams, AreInForceFromTheNextPeriodOn) {
  const sets::BlendSetup calibration = with_placed_seams(1);
  install(calibration);
  const LineVector fixed = whole(full_set(0), *calibration.plan);
  EXPECT_EQ(raymap_of(0), fixed);
  EXPECT_FALSE(stage.idle());
  EXPECT_TRUE(stage.step());
  EXPECT_TRUE(stage.idle());
  for (std::uint64_t set = 1; set < sets::kSeamPeriod; ++set) {
    EXPECT_EQ(raymap_of(set), fixed) << set;
    EXPECT_FALSE(stage.step()) << "one request a period";
  }
  // The views are those of set 0.
  const sets::PlanPtr placed = sets::place_seams(*calibration.plan, calibration.memory->seam_pictures).plan;
  ASSERT_TRUE(placed);
  const LineVector moved = whole(full_set(sets::kSeamPeriod), *placed);
  EXPECT_NE(moved, fixed);
  EXPECT_EQ(raymap_of(sets::kSeamPeriod), moved);
  EXPECT_EQ(blender.seams().counts().moved.load(), 1u);
  const auto before = blender.swap().tables_out().pop();
  ASSERT_TRUE(before);
  EXPECT_EQ(before->plan, calibration.plan) << "the keeper frees it";
  EXPECT_FALSE(before->memory) << "the blend goes on with it";
  EXPECT_FALSE(blender.swap().tables_out().pop());
}

TEST_F(PlacedSeams, OfTheSamePictures_StayAndCostNoTable) {
  install(with_placed_seams(1));
  LineVector before;
  for (std::uint64_t set = 0; set < 4 * sets::kSeamPeriod; ++set) {
    const LineVector now = raymap_of(set);
    stage.step();
    if (set > sets::kSeamPeriod) {
      EXPECT_EQ(now, before) << set;
    }
    before = now;
    blender.swap().tables_out().pop();
  }
  EXPECT_EQ(blender.seams().counts().moved.load(), 1u);
  EXPECT_EQ(blender.seams().counts().late.load(), 0u);
}

/// The first placement takes longest: the fixed seams stay until it is done.
TEST_F(PlacedSeams, AStageThatIsLate_LeavesTheOldSeamsAndIsCounted) {
  const sets::BlendSetup calibration = with_placed_seams(1);
  install(calibration);
  const LineVector fixed = whole(full_set(0), *calibration.plan);
  for (std::uint64_t set = 0; set < 2 * sets::kSeamPeriod + 3; ++set) EXPECT_EQ(raymap_of(set), fixed) << set;
  EXPECT_EQ(blender.seams().counts().late.load(), 2u) << "two further periods began";
  EXPECT_TRUE(stage.step());
  EXPECT_NE(raymap_of(2 * sets::kSeamPeriod + 3), fixed) << "from the next set on";
  EXPECT_FALSE(stage.idle()) << "a new request, in the same set";
}

TEST_F(PlacedSeams, ACalibrationSwappedMeanwhile_IsBlendedWithItsOwnSeams) {
  install(with_placed_seams(1));
  raymap_of(0);
  const sets::BlendSetup other = with_placed_seams(2, 120);
  install(other);
  const LineVector fixed = whole(full_set(1), *other.plan);
  EXPECT_EQ(raymap_of(1), fixed);
  EXPECT_TRUE(stage.step()) << "places seams for the calibration that is gone";
  EXPECT_EQ(raymap_of(2), fixed);
  EXPECT_EQ(blender.seams().counts().moved.load(), 0u);
  EXPECT_TRUE(stage.step()) << "the new one's turn";
  EXPECT_NE(raymap_of(sets::kSeamPeriod), fixed);
}

/// For takes.
TEST_F(PlacedSeams, AreLoggedWithTheFirstSetThatIsBlendedWithThem) {
  blender.seams().log().open();
  const auto logged = [&] { return blender.seams().log().changes().pop(); };
  install(with_placed_seams(1));
  raymap_of(3);
  auto change = logged();
  ASSERT_TRUE(change) << "a calibration begins with its own seams";
  EXPECT_EQ(change->first_set, 3U);
  EXPECT_FALSE(change->labels);
  EXPECT_EQ(blender.sets_begun(), 4U) << "afterwards";
  stage.step();
  raymap_of(7);
  EXPECT_FALSE(logged());
  raymap_of(10);  // 8 and 9 were not blended
  change = logged();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->first_set, 10U);
  ASSERT_TRUE(change->labels);
  EXPECT_EQ(change->labels->size(), static_cast<std::size_t>(sets::kSeamMapWidth * sets::kSeamMapWidth / 2));
  install(with_placed_seams(2, 120));
  raymap_of(12);
  change = logged();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->first_set, 12U);
  EXPECT_FALSE(change->labels);
}

TEST_F(PlacedSeams, WhileTheirLogIsFull_StayAndACalibrationsOwnAreLoggedLater) {
  blender.seams().log().open();
  const sets::BlendSetup calibration = with_placed_seams(1);
  std::uint64_t set = 0;
  for (std::size_t k = 0; k < SeamLog::kChangesWaiting + 3; ++k, ++set) {
    install(calibration);
    raymap_of(set);
    blender.swap().tables_out().pop();
    blender.swap().adoptions_out().pop();
  }
  const std::uint64_t full_from = SeamLog::kChangesWaiting;  // this set's change is the first without room
  for (std::uint64_t end = set + 3 * sets::kSeamPeriod; set < end; ++set) {
    raymap_of(set);
    stage.step();
    blender.swap().tables_out().pop();
  }
  EXPECT_EQ(blender.seams().counts().moved.load(), 0U);
  for (std::uint64_t k = 0; k < SeamLog::kChangesWaiting; ++k)
    EXPECT_EQ(blender.seams().log().changes().pop()->first_set, k);
  raymap_of(set);
  const auto own = blender.seams().log().changes().pop();
  ASSERT_TRUE(own);
  EXPECT_EQ(own->first_set, full_from);
  EXPECT_FALSE(own->labels);
  raymap_of(++set);
  const auto moved = blender.seams().log().changes().pop();
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->first_set, set);
  EXPECT_TRUE(moved->labels);
}

TEST_F(PlacedSeams, WithoutATakeToLogThemFor_AreNotLogged) {
  install(with_placed_seams(1));
  raymap_of(0);
  stage.step();
  raymap_of(sets::kSeamPeriod);
  EXPECT_EQ(blender.seams().counts().moved.load(), 1U);
  EXPECT_TRUE(blender.seams().log().changes().empty());
}

/// As with a table compiler that has a fault.
TEST_F(PlacedSeams, WhoseTableFailsItsProof_AreRefusedAndTheOldOnesStay) {
  sets::BlendPlan broken = *with_placed_seams(1).plan;
  std::ranges::fill(broken.tables[0].cover[0].coordinates, std::int16_t{20'000});  // far outside of the pictures
  const sets::BlendSetup installed = sets::with_memory(std::make_shared<const sets::BlendPlan>(std::move(broken)));
  install(installed);
  const LineVector fixed = whole(full_set(0), *installed.plan);
  for (std::uint64_t set = 0; set < 3 * sets::kSeamPeriod; ++set) {
    EXPECT_EQ(raymap_of(set), fixed) << set;
    stage.step();
  }
  EXPECT_EQ(blender.seams().counts().refused.load(), 2U) << "in the two periods after the first";
  EXPECT_NE(blender.seams().refused().read().find("blend table"), std::string::npos)
      << blender.seams().refused().read();
  EXPECT_EQ(blender.seams().counts().moved.load(), 0U);
  EXPECT_EQ(blender.seams().counts().late.load(), 0U);
}

}  // namespace
}  // namespace nodal::firmware
