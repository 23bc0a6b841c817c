#include "hal/sim/disk.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace nodal::hal::sim {
namespace {

constexpr std::uint64_t kSeeds = 200;

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

/// nullopt: the file does not exist.
std::optional<std::string> content(DiskPort& disk, const std::string& name) {
  const auto bytes = disk.read(name, 1 << 20);
  if (!bytes) return std::nullopt;
  return std::string(bytes->begin(), bytes->end());
}

Status write_file(DiskPort& disk, const std::string& name, const std::string& text, bool sync) {
  const auto file = disk.create(name);
  if (!file) return fail(file.error());
  Status status = disk.write(*file, bytes_of(text));
  if (status && sync) status = disk.sync(*file);
  disk.close(*file);
  return status;
}

/// Replaces a file so that a crash leaves either the old or the new one.
Status replace_safely(DiskPort& disk, const std::string& name, const std::string& text) {
  if (auto written = write_file(disk, name + ".tmp", text, true); !written) return written;
  if (auto renamed = disk.rename(name + ".tmp", name); !renamed) return renamed;
  return disk.sync_folder("");
}

const std::string kOld(1500, 'o');
const std::string kNew(2500, 'n');

TEST(SimDiskCrash, SyncedFileInASyncedFolder_IsThereWholeWithEverySeed) {
  SimDisk disk;
  ASSERT_TRUE(replace_safely(disk, "a", kOld));
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    EXPECT_EQ(content(*disk.after_power_loss(seed), "a"), kOld);
  }
}

// Write, fsync, rename, fsync of the folder: cut at every operation, either the old or the new file is there, complete.
TEST(SimDiskCrash, SafeReplacementCutAnywhere_LeavesTheOldOrTheNewOne) {
  std::set<std::string> seen;
  for (std::uint64_t cut = 0; cut < 5; ++cut) {
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      SimDisk disk(seed);
      ASSERT_TRUE(replace_safely(disk, "a", kOld));
      const std::uint64_t before = disk.operations();
      ASSERT_EQ(before, 5U);
      disk.die_at(before + cut);
      const Status status = replace_safely(disk, "a", kNew);
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().code, Errc::kIo);
      ASSERT_TRUE(disk.dead());
      const auto left = content(*disk.after_power_loss(seed + 1), "a");
      ASSERT_TRUE(left == kOld || left == kNew) << "cut at " << cut << ", seed " << seed;
      seen.insert(*left);
    }
  }
  EXPECT_EQ(seen.size(), 2U) << "both happen";
}

// The model's purpose: every omitted step is detected.
TEST(SimDiskCrash, ReplacementWithoutFsync_IsTornWithSomeSeed) {
  int torn = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    SimDisk disk(seed);
    ASSERT_TRUE(replace_safely(disk, "a", kOld));
    ASSERT_TRUE(write_file(disk, "a.tmp", kNew, false));
    ASSERT_TRUE(disk.rename("a.tmp", "a"));
    ASSERT_TRUE(disk.sync_folder(""));
    const auto left = content(*disk.after_power_loss(seed), "a");
    torn += left != kOld && left != kNew;
  }
  EXPECT_GT(torn, 20);
}

TEST(SimDiskCrash, ReplacementWithoutFolderSync_IsUndoneWithSomeSeed) {
  int undone = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    SimDisk disk(seed);
    ASSERT_TRUE(replace_safely(disk, "a", kOld));
    ASSERT_TRUE(write_file(disk, "a.tmp", kNew, true));
    ASSERT_TRUE(disk.rename("a.tmp", "a"));
    undone += content(*disk.after_power_loss(seed), "a") == kOld;
  }
  EXPECT_GT(undone, 20);
}

TEST(SimDiskCrash, OverwrittenInPlace_LosesTheOldOneWithSomeSeed) {
  int lost = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    SimDisk disk(seed);
    ASSERT_TRUE(replace_safely(disk, "a", kOld));
    ASSERT_TRUE(disk.remove("a"));
    ASSERT_TRUE(write_file(disk, "a", kNew, false));
    const auto left = content(*disk.after_power_loss(seed), "a");
    lost += left != kOld && left != kNew;
  }
  EXPECT_GT(lost, 20);
}

TEST(SimDiskCrash, AppendedAfterASync_TheSyncedPartStaysWhatItWas) {
  bool shorter = false;
  bool garbage = false;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    SimDisk disk(seed);
    ASSERT_TRUE(replace_safely(disk, "take", kOld));
    const FileHandle file = disk.open_append("take").value();
    ASSERT_TRUE(disk.write(file, bytes_of(kNew)));
    const std::string left = content(*disk.after_power_loss(seed), "take").value();
    ASSERT_GE(left.size(), kOld.size());
    ASSERT_EQ(left.substr(0, kOld.size()), kOld);
    shorter |= left.size() < kOld.size() + kNew.size();
    garbage |= left.substr(kOld.size()) != kNew.substr(0, left.size() - kOld.size());
  }
  EXPECT_TRUE(shorter);
  EXPECT_TRUE(garbage);
}

TEST(SimDiskCrash, FolderNotSynced_MayBeGoneWithAllInIt) {
  int gone = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    SimDisk disk(seed);
    ASSERT_TRUE(disk.make_folder("takes"));
    ASSERT_TRUE(write_file(disk, "takes/a", kOld, true));
    ASSERT_TRUE(disk.sync_folder("takes"));
    auto left = disk.after_power_loss(seed);
    if (!left->list("takes")) {
      ++gone;
      EXPECT_FALSE(content(*left, "takes/a"));
    } else {
      EXPECT_EQ(content(*left, "takes/a"), kOld);
    }
  }
  EXPECT_GT(gone, 20);
  EXPECT_LT(gone, static_cast<int>(kSeeds));
}

TEST(SimDiskCrash, SameSeed_SameDiskIsFound) {
  SimDisk disk(3);
  ASSERT_TRUE(write_file(disk, "a", kOld, false));
  ASSERT_TRUE(write_file(disk, "b", kNew, true));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto once = disk.after_power_loss(seed);
    const auto again = disk.after_power_loss(seed);
    EXPECT_EQ(once->list("").value(), again->list("").value());
    EXPECT_EQ(content(*once, "a"), content(*again, "a"));
  }
}

TEST(SimDiskCrash, PowerIsBack_TheFoundDiskWorksAndLastsLikeANewOne) {
  SimDisk disk(3);
  ASSERT_TRUE(replace_safely(disk, "a", kOld));
  disk.die_at(disk.operations());
  ASSERT_FALSE(disk.sync_folder(""));
  EXPECT_EQ(disk.read("a", 10'000).error().code, Errc::kIo) << "dead is dead";
  auto found = disk.after_power_loss(1);
  ASSERT_TRUE(replace_safely(*found, "a", kNew));
  EXPECT_EQ(content(*found->after_power_loss(2), "a"), kNew);
}

TEST(SimDiskKill, ProgramKilled_EverythingWrittenIsThereButLastsNoBetter) {
  SimDisk disk(3);
  ASSERT_TRUE(write_file(disk, "a", kOld, false));
  auto left = disk.after_kill();
  EXPECT_EQ(content(*left, "a"), kOld);
  int lost = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) lost += content(*left->after_power_loss(seed), "a") != kOld;
  EXPECT_GT(lost, 10);
  // The disk after the power loss is a separate object.
  ASSERT_TRUE(left->remove("a"));
  EXPECT_EQ(content(disk, "a"), kOld);
}

TEST(SimDisk, Full_APartIsThereAndTheErrorNamesTheFile) {
  SimDisk disk(1, 1000);
  const FileHandle file = disk.create("take.nodal").value();
  ASSERT_TRUE(disk.write(file, std::vector<std::uint8_t>(600)));
  const Status status = disk.write(file, std::vector<std::uint8_t>(600));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kDiskFull);
  EXPECT_NE(status.error().message.find("take.nodal"), std::string::npos);
  EXPECT_EQ(disk.size("take.nodal").value(), 1000U);
  EXPECT_EQ(disk.free_bytes().value(), 0U);
  disk.set_capacity(2000);
  EXPECT_TRUE(disk.write(file, std::vector<std::uint8_t>(600)));
}

TEST(SimDisk, FailAt_ThatOperationOnly) {
  SimDisk disk;
  const FileHandle file = disk.create("a").value();
  disk.fail_at(disk.operations() + 1);
  EXPECT_TRUE(disk.write(file, bytes_of("1")));
  const Status status = disk.write(file, bytes_of("2"));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kIo);
  EXPECT_TRUE(disk.write(file, bytes_of("3")));
  EXPECT_EQ(content(disk, "a"), "13");
}

TEST(SimDisk, Slow_TimePassesWithEveryChange) {
  SimClock clock;
  SimDisk disk;
  disk.be_slow(&clock, Duration::milliseconds(40));
  const Instant start = clock.now();
  ASSERT_TRUE(replace_safely(disk, "a", "x"));
  EXPECT_EQ(clock.now() - start, Duration::milliseconds(200));
}

TEST(SimDisk, Stall_OneOperationTakesLongAndTheNextDoesNot) {
  SimClock clock;
  SimDisk disk;
  const FileHandle file = disk.create("a").value();
  disk.stall(&clock, Duration::seconds(5));
  const Instant start = clock.now();
  ASSERT_TRUE(disk.write(file, bytes_of("x")));
  EXPECT_EQ(clock.now() - start, Duration::seconds(5));
  ASSERT_TRUE(disk.sync(file));
  EXPECT_EQ(clock.now() - start, Duration::seconds(5));
}

TEST(SimDisk, FailedReads_EndAndNameTheFile) {
  SimDisk disk;
  ASSERT_TRUE(replace_safely(disk, "a", "x"));
  const FileHandle file = disk.open_read("a").value();
  disk.fail_reads(2);
  std::vector<std::uint8_t> byte(1);
  const auto part = disk.read_at(file, 0, byte);
  ASSERT_FALSE(part);
  EXPECT_EQ(part.error().code, Errc::kIo);
  EXPECT_NE(part.error().message.find("'a'"), std::string::npos);
  EXPECT_FALSE(disk.read("a", 10));
  EXPECT_EQ(content(disk, "a"), "x");
}

TEST(SimDisk, ReadOnly_NothingChangesAndEverythingIsRead) {
  SimDisk disk;
  ASSERT_TRUE(replace_safely(disk, "a", "x"));
  disk.be_read_only();
  EXPECT_FALSE(disk.create("b"));
  EXPECT_FALSE(disk.remove("a"));
  const auto file = disk.open_append("a");
  ASSERT_FALSE(file);
  EXPECT_NE(file.error().message.find("read-only"), std::string::npos) << file.error().message;
  EXPECT_EQ(content(disk, "a"), "x");
  disk.be_read_only(false);
  EXPECT_TRUE(replace_safely(disk, "a", "y"));
}

}  // namespace
}  // namespace nodal::hal::sim
