// Takes in a loop on a simulated disk: the oldest segments go, those near a mark stay, and a power failure at every
// operation leaves a take that is whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "firmware/record/loop.h"
#include "firmware/record/recovery.h"
#include "firmware/record/take_writer.h"
#include "firmware/replay/take_reel.h"
#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "take_film.h"

namespace nodal::firmware {
namespace {

using namespace take_film;

/// A set every 15 s: a segment of 60 s has 5 sets, and a minute around a mark 4 to either side.
constexpr Duration kLoopPeriod = Duration::seconds(15);
constexpr std::uint64_t kSegmentSets = 5, kFirstNumber = 100;

Film slow_film(int sets) { return film(sets, kTakeHeight, 1, kLoopPeriod); }

TakeWriter::Documents slow_documents() {
  TakeWriter::Documents slow = documents();
  slow.about.rate = {1, 15};
  return slow;
}

/// Numbers of the segments that a take's folder has evidence of.
std::set<int> segments_on(hal::DiskPort& disk) {
  std::set<int> found;
  for (const std::string& name : disk.list("000042").value_or(std::vector<std::string>())) {
    if (name.starts_with("evidence-")) found.insert(std::stoi(name.substr(9)));
  }
  return found;
}

take::Manifest manifest_on(hal::DiskPort& disk) {
  const Bytes text = read(disk, take::kManifestFile);
  const auto parsed = take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()}, "manifest");
  EXPECT_TRUE(parsed) << parsed.error().text();
  return parsed.value_or(take::Manifest());
}

/// Ten segments with a mark at set 22, finished.
std::unique_ptr<hal::sim::SimDisk> marked_take() {
  auto disk = std::make_unique<hal::sim::SimDisk>();
  const Film made = slow_film(50);
  auto writer = TakeWriter::begin(*disk, slow_documents());
  EXPECT_TRUE(writer);
  for (std::size_t k = 0; k < made.rows.size(); ++k) {
    if (k == 22) {
      EXPECT_TRUE((*writer)->mark("here", Instant()));
    }
    EXPECT_TRUE((*writer)->write(made.rows[k]));
  }
  EXPECT_TRUE((*writer)->end("stopped"));
  return disk;
}

TEST(Loop, AMinuteAroundAMark_IsTwoSegmentsOrThree) {
  const std::vector<take::Manifest::Mark> marks{{22, "here"}};
  const FrameRate rate{1, 15};
  for (std::uint64_t segment = 0; segment < 10; ++segment) {
    const std::uint64_t first = segment * kSegmentSets, last = first + kSegmentSets - 1;
    EXPECT_EQ(near_mark(first, last, marks, rate), segment >= 3 && segment <= 5) << segment;
  }
  EXPECT_TRUE(near_mark(0, 18, marks, rate));
  EXPECT_FALSE(near_mark(0, 17, marks, rate));
  EXPECT_TRUE(near_mark(26, 30, marks, rate));
  EXPECT_FALSE(near_mark(27, 30, marks, rate));
  EXPECT_FALSE(near_mark(0, 100, {}, rate));
}

TEST(Loop, OfARunningTake_TheOldestSegmentsGoAndThoseNearAMarkStay) {
  hal::sim::SimDisk disk;
  const Film made = slow_film(48);
  auto writer = TakeWriter::begin(disk, slow_documents());
  ASSERT_TRUE(writer);
  for (std::size_t k = 0; k < made.rows.size(); ++k) {
    if (k == 22) {
      ASSERT_TRUE((*writer)->mark("here", Instant()));
    }
    ASSERT_TRUE((*writer)->write(made.rows[k]));
  }
  const std::uint64_t before = disk.total_bytes().value() - disk.free_bytes().value();
  std::uint64_t freed = 0;
  for (const int left : {1, 2, 3, 3, 3, 3, 3}) {
    const auto deleted = (*writer)->delete_oldest();
    ASSERT_TRUE(deleted) << deleted.error().text();
    freed += deleted->value_or(0);
    EXPECT_EQ(*segments_on(disk).begin(), left);
  }
  EXPECT_EQ(before - (disk.total_bytes().value() - disk.free_bytes().value()), freed);
  EXPECT_EQ(segments_on(disk), (std::set<int>{3, 4, 5, 9})) << "the last one is being written";
  const auto manifest = (*writer)->end("stopped");
  ASSERT_TRUE(manifest) << manifest.error().text();
  EXPECT_EQ(check(disk, *manifest), 18U);
  EXPECT_EQ(manifest->deleted_sets, 30U);
  EXPECT_EQ(manifest->marks, (std::vector<take::Manifest::Mark>{{22, "here"}}));
}

TEST(Loop, OfAFinishedTake_WhatIsLeftIsWholeAndPlaysInOrder) {
  auto disk = marked_take();
  for (const std::set<int>& left : {std::set<int>{1, 2, 3, 4, 5, 6, 7, 8, 9}, {2, 3, 4, 5, 6, 7, 8, 9}}) {
    const auto trimmed = trim_take(*disk, "000042");
    ASSERT_TRUE(trimmed) << trimmed.error().text();
    ASSERT_TRUE(trimmed->has_value());
    EXPECT_EQ(segments_on(*disk), left);
    EXPECT_EQ(check(*disk, manifest_on(*disk)), left.size() * kSegmentSets);
  }
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(trim_take(*disk, "000042").value_or(std::nullopt)) << k;
  EXPECT_FALSE(trim_take(*disk, "000042").value().has_value()) << "the mark keeps the rest";
  const take::Manifest manifest = manifest_on(*disk);
  EXPECT_EQ(segments_on(*disk), (std::set<int>{3, 4, 5}));
  EXPECT_EQ(check(*disk, manifest), 15U);
  EXPECT_EQ(manifest.deleted_sets, 35U);
  EXPECT_EQ(manifest.length, kLoopPeriod * 15);
  const auto reel = open_take_reel(std::move(disk), "000042", "take", "a");
  ASSERT_TRUE(reel) << reel.error().text();
  ASSERT_EQ((*reel)->size(), 15U);
  for (std::size_t k = 0; k < 15; ++k) {
    const hal::replay::Shot shot = (*reel)->shot(k);
    ASSERT_TRUE(shot.picture) << k;
    EXPECT_EQ(shot.picture->bytes, picture(kFirstNumber + 15 + k, 0)) << k;
  }
}

/// A calibration is no part of a segment, though its name has a number, too.
TEST(Loop, SegmentsAreDeletedThatNamedACalibration_TheOthersNameItToo) {
  hal::sim::SimDisk disk;
  const Film made = slow_film(30);
  const TakeCalibration second{kFirstNumber + 2, Sha256{1}, "{\"second\":2}"};
  const TakeCalibration third{kFirstNumber + 7, Sha256{}, "{\"third\":3}"};
  {
    auto writer = TakeWriter::begin(disk, slow_documents());
    ASSERT_TRUE(writer);
    for (std::size_t k = 0; k < made.rows.size(); ++k) {
      if (k == 2) {
        ASSERT_TRUE((*writer)->use_calibration(second));
        ASSERT_TRUE((*writer)->use_calibration(second)) << "it is in force";
      }
      if (k == 7) {
        ASSERT_TRUE((*writer)->use_calibration(third));
      }
      ASSERT_TRUE((*writer)->write(made.rows[k]));
    }
    ASSERT_TRUE((*writer)->delete_oldest());
    ASSERT_TRUE((*writer)->delete_oldest());
  }
  const auto recovered = recover_take(disk, "000042");
  ASSERT_TRUE(recovered) << recovered.error().text();
  ASSERT_TRUE(trim_take(disk, "000042").value_or(std::nullopt));
  const take::Manifest manifest = manifest_on(disk);
  EXPECT_EQ(segments_on(disk), (std::set<int>{3, 4, 5}));
  const std::vector<take::Manifest::Calibration> expected{
      {"calibration-0001.json", to_hex(second.id), second.first_set},
      {"calibration-0002.json", to_hex(third.id), third.first_set}};
  EXPECT_EQ(manifest.calibrations, expected);
  EXPECT_EQ(check(disk, manifest), 15U) << "with the hashes of all files";
  const Bytes text = read(disk, "calibration-0002.json");
  EXPECT_EQ(std::string(text.begin(), text.end()), third.json);
}

TEST(Loop, PowerCutWhileASegmentOfARunningTakeIsDeleted_LosesNothingElse) {
  const Film made = slow_film(30);
  const auto run = [&](hal::sim::SimDisk& disk) {
    std::uint64_t durable = 0;
    auto writer = TakeWriter::begin(disk, slow_documents());
    if (!writer) return durable;
    for (std::size_t k = 0; k < made.rows.size(); ++k) {
      if (!(*writer)->write(made.rows[k]) || !(*writer)->sync(Instant(), 0)) return durable;
      durable = (*writer)->sets();
      // From here on the disk has room for three segments.
      if (k >= 15 && k % kSegmentSets == 2 && !(*writer)->delete_oldest()) return durable;
    }
    return durable;
  };
  hal::sim::SimDisk counted;
  EXPECT_EQ(run(counted), 30U);
  int gaps = 0;
  for (std::uint64_t k = 0; k < counted.operations(); ++k) {
    SCOPED_TRACE("operation " + std::to_string(k));
    hal::sim::SimDisk disk(k);
    disk.die_at(k);
    const std::uint64_t durable = run(disk);
    const auto left = disk.after_power_loss(k + 1);
    if (!left->size("000042/" + take::kTakeFile)) continue;
    const auto manifest = recover_take(*left, "000042");
    ASSERT_TRUE(manifest) << manifest.error().text();
    const std::uint64_t sets = check(*left, *manifest);
    EXPECT_GE(sets + manifest->deleted_sets, durable);
    EXPECT_GE(sets, std::min<std::uint64_t>(durable, 2 * kSegmentSets));
    EXPECT_EQ(manifest->deleted_sets % kSegmentSets, 0U);
    gaps += manifest->deleted_sets != 0 ? 1 : 0;
  }
  EXPECT_GT(gaps, 10);
}

TEST(Loop, PowerCutWhileAFinishedTakeIsTrimmed_LeavesItWholeAndTheNextGoesOn) {
  const auto made = marked_take();
  const auto counted = made->after_kill();
  ASSERT_TRUE(trim_take(*counted, "000042").value_or(std::nullopt));
  int before = 0, after = 0;
  for (std::uint64_t k = 0; k < counted->operations(); ++k) {
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      SCOPED_TRACE("operation " + std::to_string(k) + " seed " + std::to_string(seed));
      const auto disk = made->after_power_loss(seed);  // what was recorded is durable
      disk->die_at(k);
      (void)trim_take(*disk, "000042");
      const auto left = disk->after_power_loss(seed + 1);
      const take::Manifest manifest = manifest_on(*left);
      EXPECT_EQ(check(*left, manifest) + manifest.deleted_sets, 50U);
      ++(manifest.deleted_sets == 0 ? before : after);
      const auto next = trim_take(*left, "000042");
      ASSERT_TRUE(next) << next.error().text();
      ASSERT_TRUE(next->has_value());
      EXPECT_EQ(segments_on(*left).size() * kSegmentSets, 50 - (*next)->manifest.deleted_sets)
          << "files of an interrupted call are removed";
      EXPECT_EQ(check(*left, (*next)->manifest) + (*next)->manifest.deleted_sets, 50U);
    }
  }
  EXPECT_GT(before, 4);
  EXPECT_GT(after, 4);
}

}  // namespace
}  // namespace nodal::firmware
