// Which sets place seams, and from which set on they are in force.
#include "stitch/sets/seam_schedule.h"

#include <gtest/gtest.h>

#include <memory>

namespace nodal::sets {
namespace {

PlacedSeams some_seams() { return {std::make_shared<const BlendPlan>(), ""}; }

TEST(SeamSchedule, TheFirstSetOfAPeriodPlacesThem_AndTheNextPeriodHasThem) {
  SeamSchedule schedule;
  EXPECT_TRUE(schedule.wants(3)) << "also in the middle of a period, with a new calibration";
  schedule.begin(3);
  schedule.placed(some_seams());
  for (std::uint64_t set = 3; set < kSeamPeriod; ++set) {
    EXPECT_FALSE(schedule.wants(set)) << set;
    EXPECT_FALSE(schedule.due(set)) << set;
  }
  ASSERT_TRUE(schedule.due(kSeamPeriod));
  EXPECT_FALSE(schedule.outdated());
  EXPECT_FALSE(schedule.wants(kSeamPeriod)) << "not before the ones that are due are taken";
  EXPECT_TRUE(schedule.take().plan);
  EXPECT_FALSE(schedule.due(kSeamPeriod));
  EXPECT_TRUE(schedule.wants(kSeamPeriod));
}

TEST(SeamSchedule, AnUnfinishedPlacing_MakesEachFurtherPeriodLateOnce) {
  SeamSchedule schedule;
  schedule.begin(0);
  EXPECT_FALSE(schedule.is_late(1)) << "in its own period";
  for (std::uint64_t period = 1; period < 3; ++period) {
    EXPECT_TRUE(schedule.is_late(period * kSeamPeriod));
    EXPECT_FALSE(schedule.is_late(period * kSeamPeriod + 1));
    EXPECT_FALSE(schedule.wants(period * kSeamPeriod));
  }
  schedule.placed(some_seams());
  EXPECT_TRUE(schedule.due(3 * kSeamPeriod - 1)) << "at once";
}

TEST(SeamSchedule, AfterANewCalibration_SeamsForTheOldOneAreOutdatedAndDueAtOnce) {
  SeamSchedule schedule;
  schedule.begin(0);
  schedule.restart();
  EXPECT_TRUE(schedule.outdated());
  EXPECT_FALSE(schedule.wants(1)) << "the views are still in use";
  schedule.placed(some_seams());
  EXPECT_TRUE(schedule.due(1));
  schedule.take();
  EXPECT_FALSE(schedule.outdated());
  EXPECT_TRUE(schedule.wants(1));
}

TEST(SeamSchedule, RecordedSeams_ComeIntoForceOnce) {
  SeamSchedule schedule;
  EXPECT_FALSE(schedule.follow(std::nullopt)) << "the calibration's own are in force from the start";
  EXPECT_TRUE(schedule.follow(5));
  EXPECT_FALSE(schedule.follow(5));
  EXPECT_TRUE(schedule.follow(13));
  EXPECT_TRUE(schedule.follow(std::nullopt));
}

}  // namespace
}  // namespace nodal::sets
