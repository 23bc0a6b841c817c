#include "firmware/operate/take_watch.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

namespace nodal::firmware {
namespace {

Sha256 marked(std::uint8_t mark) {
  Sha256 id{};
  id.fill(mark);
  return id;
}

/// A rig that is ready to record.
class TakeWatchTest : public testing::Test {
 protected:
  TakeWatchTest() {
    takes_.ready = true;
    keeper_.ready = true;
    capture_.full_sets = 1;
  }
  bool step(std::int64_t seconds) {
    return watch_.step({&capture_, &keeper_, &takes_}, news_, Instant() + Duration::seconds(seconds));
  }
  /// The calibration is in force, and the blend has adopted it in this set.
  void adopt(std::uint8_t mark, std::uint64_t set) {
    keeper_.in_force = marked(mark);
    keeper_.document = std::make_shared<const std::string>("document " + std::to_string(mark));
    adoption_.publish({set, marked(mark)});
  }

  CaptureReport capture_;
  KeeperReport keeper_;
  TakeReport takes_;
  News news_{Instant()};
  Snapshot<Adoption> adoption_;
  SpscRing<TakeCalibration> calibrations_{4};
  TakeWatch watch_{adoption_, &calibrations_, true};
};

using Sentences = std::vector<std::string>;

TEST_F(TakeWatchTest, ATakeThatDoesNotStart_IsTriedAgainAfterWaitsThatDouble) {
  std::vector<std::int64_t> tries;
  for (std::int64_t second = 0; second < 200; ++second) {
    if (step(second)) tries.push_back(second);
  }
  EXPECT_EQ(tries, (std::vector<std::int64_t>{0, 2, 6, 14, 30, 62, 126, 190}));
}

TEST_F(TakeWatchTest, WithoutStartAtBoot_NoTakeIsStarted) {
  TakeWatch watch(adoption_, &calibrations_, false);
  EXPECT_FALSE(watch.step({&capture_, &keeper_, &takes_}, news_, Instant()));
}

TEST_F(TakeWatchTest, WithoutFramesDiskOrRoom_ATakeWaits) {
  capture_.full_sets = 0;
  EXPECT_FALSE(step(0));
  capture_.full_sets = 1;
  takes_.ready = false;
  EXPECT_FALSE(step(1));
  takes_.ready = true;
  takes_.has_room = false;
  EXPECT_FALSE(step(2));
  takes_.has_room = true;
  EXPECT_TRUE(step(3));
}

TEST_F(TakeWatchTest, ATakeThatSomebodyStopped_StaysStoppedAndAnInterruptedOneIsFollowedByAnother) {
  takes_.recording = 1;
  EXPECT_FALSE(step(0));
  takes_.recording.reset();
  EXPECT_FALSE(step(10)) << "stopped";
  takes_.interrupted = true;
  EXPECT_TRUE(step(20));
}

TEST_F(TakeWatchTest, ANewDisk_IsTriedAtOnce) {
  EXPECT_TRUE(step(0));
  EXPECT_FALSE(step(1));
  ++takes_.disks;
  EXPECT_TRUE(step(1));
}

TEST_F(TakeWatchTest, ProblemsAndTheDisk_AreSaidWhenTheyChange) {
  takes_.problem = "the disk is slow";
  takes_.no_disk = "no card";
  step(0);
  step(1);
  EXPECT_EQ(news_.take(), (Sentences{"the disk is slow", "the disk of the takes: no card"}));
  takes_.problem.clear();
  takes_.no_disk.clear();
  step(2);
  EXPECT_EQ(news_.take(), Sentences{"the disk of the takes is there"});
}

TEST_F(TakeWatchTest, ATake_GetsEachCalibrationThatTheBlendAdoptsOnce) {
  adopt(1, 0);
  takes_.recording = 1;
  watch_.note_start(marked(1));
  step(0);
  EXPECT_FALSE(calibrations_.pop()) << "it began with it";
  adopt(2, 90);
  step(1);
  step(2);
  const auto notice = calibrations_.pop();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->first_set, 90u);
  EXPECT_EQ(notice->id, marked(2));
  EXPECT_EQ(notice->json, "document 2");
  EXPECT_FALSE(calibrations_.pop());
}

TEST_F(TakeWatchTest, TheCalibrationBefore_IsToldAlsoWhenTheNextIsInForceAlready) {
  adopt(1, 0);
  takes_.recording = 1;
  step(0);
  ASSERT_TRUE(calibrations_.pop());
  adopt(2, 90);
  keeper_.in_force = marked(2);
  step(1);
  ASSERT_TRUE(calibrations_.pop());
  keeper_.in_force = marked(3);
  keeper_.document = std::make_shared<const std::string>("document 3");
  step(2);
  adoption_.publish({95, marked(1)});
  step(3);
  const auto notice = calibrations_.pop();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->json, "document 1");
}

}  // namespace
}  // namespace nodal::firmware
