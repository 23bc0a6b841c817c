#include "firmware/record/seam_feed.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "firmware/record/take_row.h"
#include "firmware/record/take_writer.h"
#include "hal/sim/disk.h"
#include "protocol/take/evidence.h"
#include "protocol/take/seam_map.h"
#include "take_film.h"

namespace nodal::firmware {
namespace {

sets::SeamLabels some_labels(std::uint8_t value) {
  return std::make_shared<const std::vector<std::uint8_t>>(
      static_cast<std::size_t>(sets::kSeamMapWidth * sets::kSeamMapWidth / 2), value);
}

TakeRow row_up_to(std::uint64_t set) {
  TakeRow row;
  row.sets.emplace_back().number = set;
  return row;
}

Instant after(Duration time) { return Instant() + time; }

TEST(SeamFeed, Made_OpensTheBlendsLog) {
  SeamLog log;
  EXPECT_FALSE(log.is_open());
  const SeamFeed feed(&log);
  EXPECT_TRUE(log.is_open());
}

TEST(SeamFeed, ARow_WaitsUntilTheBlendHasBegunItsSets) {
  SeamLog log;
  SeamFeed feed(&log);
  log.begin(4);
  EXPECT_TRUE(feed.is_behind(row_up_to(5), after(Duration())));
  EXPECT_FALSE(feed.is_behind(row_up_to(4), after(Duration())));
  EXPECT_FALSE(feed.is_behind(TakeRow(), after(Duration()))) << "a row without sets";
  log.begin(5);
  EXPECT_FALSE(feed.is_behind(row_up_to(5), after(Duration())));
}

TEST(SeamFeed, ABlendThatDoesNotGoOn_IsWaitedForOneSecondAfterItsLastSet) {
  SeamLog log;
  SeamFeed feed(&log);
  log.begin(4);
  EXPECT_TRUE(feed.is_behind(row_up_to(9), after(Duration::seconds(5))));
  EXPECT_TRUE(feed.is_behind(row_up_to(9), after(Duration::milliseconds(5999))));
  log.begin(5);
  EXPECT_TRUE(feed.is_behind(row_up_to(9), after(Duration::milliseconds(6500))));
  EXPECT_FALSE(feed.is_behind(row_up_to(9), after(Duration::milliseconds(7500))));
}

TEST(SeamFeed, FixedSeamsOrTheEnd_LetNoRowWait) {
  SeamFeed fixed(nullptr);
  EXPECT_FALSE(fixed.is_behind(row_up_to(9), after(Duration())));
  EXPECT_FALSE(fixed.step(nullptr));
  SeamLog log;
  SeamFeed feed(&log);
  feed.close();
  EXPECT_FALSE(feed.is_behind(row_up_to(9), after(Duration())));
}

TEST(SeamFeed, SeamsFromBeforeATake_AreTheFirstInIt) {
  SeamLog log;
  SeamFeed feed(&log);
  ASSERT_TRUE(log.changes().push({40, some_labels(0)}));
  ASSERT_TRUE(log.changes().push({96, some_labels(1)}));
  EXPECT_TRUE(feed.step(nullptr));
  EXPECT_FALSE(feed.step(nullptr)) << "all were taken";

  hal::sim::SimDisk disk;
  auto writer = TakeWriter::begin(disk, take_film::documents());
  ASSERT_TRUE(writer);
  feed.begin(**writer);
  const take_film::Film film = take_film::film(1);
  ASSERT_TRUE((*writer)->write(film.rows[0]));
  ASSERT_TRUE((*writer)->end("stopped"));
  const std::vector<std::string> names = disk.list("000042").value();
  for (const std::string& name : names) {
    if (!name.starts_with("evidence-")) continue;
    const auto segment = take::read_evidence(take_film::read(disk, name), name);
    ASSERT_TRUE(segment);
    ASSERT_EQ(segment->seams.size(), 1u);
    EXPECT_EQ(segment->seams[0].set(), 96u);
    EXPECT_EQ(*take::labels_of(segment->seams[0]), *some_labels(1));
  }
}

}  // namespace
}  // namespace nodal::firmware
