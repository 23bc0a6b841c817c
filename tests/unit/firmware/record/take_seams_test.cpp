// Placed seams in takes: each set's are in the evidence of its segment, whatever is deleted or lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware/record/recovery.h"
#include "firmware/record/take_writer.h"
#include "firmware/replay/take_reel.h"
#include "hal/sim/disk.h"
#include "protocol/take/seam_map.h"
#include "take_film.h"

namespace nodal::firmware {
namespace {

using namespace take_film;

constexpr Duration kSlowPeriod = Duration::seconds(15);  // a segment of 60 s has 5 sets

/// A map that differs from those of other numbers.
sets::SeamLabels labels(std::uint8_t number) {
  std::vector<std::uint8_t> map(static_cast<std::size_t>(sets::kSeamMapWidth * sets::kSeamMapWidth / 2), 0);
  std::fill_n(map.begin(), 100 + number, std::uint8_t{2});
  return std::make_shared<const std::vector<std::uint8_t>>(std::move(map));
}

/// By first set; those before the take are from earlier sets on.
std::map<std::uint64_t, sets::SeamLabels> changes() {
  return {{40, labels(1)}, {96, labels(2)}, {103, labels(3)}, {105, nullptr}, {110, labels(4)}, {118, labels(5)}};
}

/// Writes a film of 30 sets, a set a row, until the disk fails; the seams come as the blend logs them.
std::uint64_t record_with_seams(hal::DiskPort& disk, bool end, bool deletes = false) {
  const Film made = take_film::film(30, kTakeHeight, 1, kSlowPeriod);
  TakeWriter::Documents slow = documents();
  slow.about.rate = {1, 15};
  auto writer = TakeWriter::begin(disk, slow);
  if (!writer) return 0;
  const auto seams = changes();
  (*writer)->use_seams({96, seams.at(96)});  // the newest before the take
  std::uint64_t durable = 0;
  for (std::size_t k = 0; k < made.rows.size(); ++k) {
    const std::uint64_t set = made.rows[k].sets.front().number;
    // Two sets ahead, and several at once.
    if (set == 101) {
      (*writer)->use_seams({103, seams.at(103)});
      (*writer)->use_seams({105, seams.at(105)});
    }
    if (set == 110 || set == 118) (*writer)->use_seams({set, seams.at(set)});
    if (!(*writer)->write(made.rows[k]) || !(*writer)->sync(Instant(), 0)) return durable;
    durable = (*writer)->sets();
    if (deletes && k >= 15 && k % 5 == 2 && !(*writer)->delete_oldest()) return durable;
  }
  if (end) {
    EXPECT_TRUE((*writer)->end("stopped"));
  }
  return durable;
}

/// Compares the seams of every set on the disk. Returns the number of sets.
std::uint64_t check_seams_of_sets(hal::DiskPort& disk) {
  const auto expected = changes();
  std::uint64_t sets = 0;
  for (const std::string& name : disk.list("000042").value_or(std::vector<std::string>())) {
    if (!name.starts_with("evidence-")) continue;
    const auto segment = take::read_evidence(read(disk, name), name);
    EXPECT_TRUE(segment) << segment.error().text();
    if (!segment) continue;
    for (const take::wire::Set& set : segment->sets) {
      const auto found = std::ranges::upper_bound(segment->seams, set.number(), {}, &take::wire::Seams::set);
      EXPECT_NE(found, segment->seams.begin()) << "set " << set.number();
      if (found == segment->seams.begin()) continue;
      const auto of_set = std::prev(expected.upper_bound(set.number()));
      EXPECT_EQ(std::prev(found)->set(), of_set->first) << "set " << set.number();
      const auto map = take::labels_of(*std::prev(found));
      EXPECT_TRUE(map);
      EXPECT_EQ(map.value_or(std::vector<std::uint8_t>()),
                of_set->second ? *of_set->second : std::vector<std::uint8_t>());
      ++sets;
    }
  }
  return sets;
}

TEST(TakeSeams, OfEverySet_AreInTheEvidenceOfItsSegment) {
  hal::sim::SimDisk disk;
  EXPECT_EQ(record_with_seams(disk, true), 30U);
  EXPECT_EQ(check_seams_of_sets(disk), 30U);
}

TEST(TakeSeams, SegmentsAreDeletedThatHadThem_TheOthersHaveThemToo) {
  hal::sim::SimDisk disk;
  record_with_seams(disk, true, true);
  const std::uint64_t left = check_seams_of_sets(disk);
  EXPECT_GE(left, 10U);
  EXPECT_LE(left, 20U);
}

TEST(TakeSeams, PowerCutAnywhere_SetsThatAreLeftHaveTheirs) {
  hal::sim::SimDisk counted;
  record_with_seams(counted, false);
  std::uint64_t most = 0;
  for (std::uint64_t k = 0; k < counted.operations(); k += 3) {
    SCOPED_TRACE("operation " + std::to_string(k));
    hal::sim::SimDisk disk(k);
    disk.die_at(k);
    const std::uint64_t durable = record_with_seams(disk, false);
    const auto left = disk.after_power_loss(k + 1);
    if (!left->size("000042/" + take::kTakeFile)) continue;
    ASSERT_TRUE(recover_take(*left, "000042"));
    const std::uint64_t sets = check_seams_of_sets(*left);
    EXPECT_GE(sets, durable);
    most = std::max(most, sets);
  }
  EXPECT_GE(most, 25U);
}

/// The hashes are right, but the map is not of this take.
TEST(TakeSeams, AMapWithAHeadThatTheTakeDoesNotHave_IsRefusedByName) {
  auto disk = std::make_unique<hal::sim::SimDisk>();
  const Film made = take_film::film(2);
  auto writer = TakeWriter::begin(*disk, documents());
  ASSERT_TRUE(writer);
  const std::size_t pixels = static_cast<std::size_t>(sets::kSeamMapWidth * sets::kSeamMapWidth / 2);
  (*writer)->use_seams({101, std::make_shared<const std::vector<std::uint8_t>>(pixels, std::uint8_t{kTakeHeads})});
  for (const TakeRow& row : made.rows) ASSERT_TRUE((*writer)->write(row));
  ASSERT_TRUE((*writer)->end("stopped"));
  const auto reel = open_take_reel(std::move(disk), "000042", "take", "a");
  ASSERT_FALSE(reel);
  const std::string& message = reel.error().message;
  EXPECT_NE(message.find("take/evidence-0000: the seams from set 101 on"), std::string::npos) << message;
}

}  // namespace
}  // namespace nodal::firmware
