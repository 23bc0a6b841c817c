// What the store keeps of settings, on a disk that fails at every call in turn or loses its power there.
#include <gtest/gtest.h>

#include <memory>

#include "firmware/storage/durable_file.h"
#include "firmware/storage/settings_store.h"
#include "firmware/storage/start_count.h"
#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

using hal::sim::SimDisk;

/// The file's text; nothing if it is not there.
std::optional<std::string> text_of(SimDisk& disk, const std::string& file) {
  const auto bytes = disk.read(file, kMaxSettingsBytes);
  if (!bytes) return std::nullopt;
  return std::string(bytes->begin(), bytes->end());
}

void put(SimDisk& disk, const std::string& file, std::string_view text) {
  const Status written = write_durably(disk, "", file, text);
  ASSERT_TRUE(written) << written.error().text();
}

TEST(WriteDurably, TheDiskFailsAtAnyCall_TheOldContentsStayAndItIsAnError) {
  SimDisk counted;
  put(counted, "file", "old");
  const std::uint64_t before = counted.operations();
  put(counted, "file", "new");
  const std::uint64_t calls = counted.operations() - before;
  ASSERT_GE(calls, 5u) << "create, write, sync, rename, sync of the folder";
  for (std::uint64_t k = 0; k < calls; ++k) {
    SimDisk disk;
    put(disk, "file", "old");
    disk.fail_at(disk.operations() + k);
    const Status written = write_durably(disk, "", "file", "new");
    ASSERT_FALSE(written) << "call " << k;
    EXPECT_EQ(written.error().code, Errc::kIo);
    EXPECT_EQ(text_of(disk, "file"), k + 1 < calls ? "old" : "new") << "call " << k;
    EXPECT_EQ(text_of(disk, "file" + std::string(kTemporarySuffix)), std::nullopt) << "call " << k;
  }
}

TEST(WriteDurably, ThePowerFailsAtAnyCall_TheContentsAreOldOrNewAndWholeAndNewAfterSuccess) {
  for (std::uint64_t k = 0; k <= 6; ++k) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      SimDisk disk(seed);
      put(disk, "file", "old");
      disk.die_at(disk.operations() + k);
      const bool done = write_durably(disk, "", "file", "new").has_value();
      const auto found = text_of(*disk.after_power_loss(seed), "file");
      EXPECT_TRUE(found == "new" || (!done && found == "old")) << "call " << k << ": " << found.value_or("nothing");
    }
  }
}

TEST(StartCount, TwoStartsThatFail_AreFollowedByOneWithoutTheSettings) {
  SimDisk disk;
  put(disk, kSettingsFile, "settings");
  EXPECT_EQ(StartCount(disk).begin(), std::nullopt);
  EXPECT_EQ(text_of(disk, kStartsFile), "1");
  EXPECT_EQ(StartCount(disk).begin(), std::nullopt);
  EXPECT_EQ(text_of(disk, kStartsFile), "2");
  const auto aside = StartCount(disk).begin();
  ASSERT_TRUE(aside);
  EXPECT_EQ(
      *aside,
      "the rig failed 2 times with the stored settings; it starts with those of rig.toml; the stored ones are kept "
      "in the store as settings-aside");
  EXPECT_EQ(text_of(disk, kSettingsFile), std::nullopt);
  EXPECT_EQ(text_of(disk, kSettingsAsideFile), "settings");
  EXPECT_EQ(text_of(disk, kStartsFile), std::nullopt) << "the next settings begin anew";
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_EQ(text_of(*disk.after_power_loss(seed), kSettingsFile), std::nullopt) << "it is durable";
  }
}

TEST(StartCount, AnyFile_IsOneDigitOrCountsAsNoFailure) {
  for (const auto& [file, next] : std::vector<std::pair<std::string, std::string>>{
           {"0", "1"}, {"1", "2"}, {"", "1"}, {"/", "1"}, {":", "1"}, {"x", "1"}, {"22", "1"}}) {
    SimDisk disk;
    put(disk, kStartsFile, file);
    EXPECT_EQ(StartCount(disk).begin(), std::nullopt) << file;
    EXPECT_EQ(text_of(disk, kStartsFile), next) << file;
  }
  for (const std::string file : {"2", "3", "9"}) {
    SimDisk disk;
    put(disk, kStartsFile, file);
    put(disk, kSettingsFile, "settings");
    EXPECT_NE(StartCount(disk).begin().value_or("").find("failed " + file + " times"), std::string::npos) << file;
  }
}

TEST(StartCount, PuttingAsideFails_ItSaysThatTheyAreIgnoredAndWhy) {
  for (std::uint64_t k = 0; k < 3; ++k) {  // rename, remove, sync of the folder
    SimDisk disk;
    put(disk, kStartsFile, "2");
    put(disk, kSettingsFile, "settings");
    disk.fail_at(disk.operations() + k);
    const auto aside = StartCount(disk).begin();
    ASSERT_TRUE(aside);
    EXPECT_NE(aside->find("the stored ones are ignored: "), std::string::npos) << "call " << k << ": " << *aside;
  }
}

TEST(StartCount, ARunThatSucceeded_ResetsTheCountOnceAndDurably) {
  SimDisk disk;
  put(disk, kStartsFile, "1");
  StartCount starts(disk);
  starts.succeeded();
  EXPECT_EQ(text_of(disk, kStartsFile), "1") << "nothing was begun";
  EXPECT_EQ(starts.begin(), std::nullopt);
  starts.succeeded();
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_EQ(text_of(*disk.after_power_loss(seed), kStartsFile), std::nullopt);
  }
  const std::uint64_t operations = disk.operations();
  starts.succeeded();
  EXPECT_EQ(disk.operations(), operations);
}

TEST(StartCount, TheDiskFails_TheRigStartsAnyway) {
  SimDisk disk;
  put(disk, kSettingsFile, "settings");
  disk.be_read_only();
  StartCount starts(disk);
  EXPECT_EQ(starts.begin(), std::nullopt);
  starts.succeeded();
}

TEST(SettingsStoreTest, NoFile_IsReportedAsNoneAndCountsNoStart) {
  SimDisk disk;
  SettingsStore store(disk);
  EXPECT_EQ(store.snapshot().read().file, std::nullopt) << "not read yet";
  EXPECT_TRUE(store.step());
  EXPECT_EQ(store.snapshot().read().file, "");
  EXPECT_EQ(store.snapshot().read().problem, "");
  EXPECT_EQ(text_of(disk, kStartsFile), std::nullopt);
  EXPECT_FALSE(store.step()) << "nothing to do";
}

TEST(SettingsStoreTest, AFile_IsReadAndItsStartCountedUntilTheRunIsStable) {
  SimDisk disk;
  put(disk, kSettingsFile, "contents");
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  EXPECT_EQ(store.snapshot().read().file, "contents");
  EXPECT_EQ(store.snapshot().read().problem, "");
  EXPECT_FALSE(store.step());
  EXPECT_EQ(text_of(disk, kStartsFile), "1");
  store.note_stable_run();
  (void)store.step();
  EXPECT_EQ(text_of(disk, kStartsFile), std::nullopt);
}

TEST(SettingsStoreTest, ARunThatIsEndedByRequest_IsNoFailure) {
  SimDisk disk;
  put(disk, kSettingsFile, "contents");
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  store.close();
  EXPECT_EQ(text_of(disk, kStartsFile), std::nullopt);
}

TEST(SettingsStoreTest, TwoStartsFailed_TheThirdHasNoneAndSaysWhere) {
  SimDisk disk;
  put(disk, kSettingsFile, "contents");
  put(disk, kStartsFile, "2");
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  EXPECT_EQ(store.snapshot().read().file, "");
  EXPECT_NE(store.snapshot().read().problem.find("settings-aside"), std::string::npos);
}

TEST(SettingsStoreTest, AFileThatCannotBeRead_IsAProblemAndNoneIsUsed) {
  SimDisk disk;
  put(disk, kSettingsFile, "contents");
  disk.fail_reads(1);
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  EXPECT_EQ(store.snapshot().read().file, "");
  EXPECT_TRUE(store.snapshot().read().problem.starts_with("could not read the stored settings, "));
  EXPECT_EQ(text_of(disk, kStartsFile), std::nullopt) << "none were restored";
}

TEST(SettingsStoreTest, Writes_AreAnsweredInOrderAndAFailureNamesTheSettings) {
  SimDisk disk;
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  ASSERT_TRUE(store.writes().push("one"));
  EXPECT_TRUE(store.step());
  const auto first = store.answers().pop();
  ASSERT_TRUE(first);
  EXPECT_TRUE(*first);
  EXPECT_EQ(text_of(disk, kSettingsFile), "one");
  disk.fail_at(disk.operations());
  ASSERT_TRUE(store.writes().push("two"));
  EXPECT_TRUE(store.step());
  const auto second = store.answers().pop();
  ASSERT_TRUE(second && !*second);
  EXPECT_TRUE(second->error().message.starts_with("settings: ")) << second->error().message;
  EXPECT_EQ(text_of(disk, kSettingsFile), "one");
}

TEST(SettingsStoreTest, NobodyTakesAnswers_WritesWaitAndNoneIsLost) {
  SimDisk disk;
  SettingsStore store(disk);
  EXPECT_TRUE(store.step());
  int written = 0;
  for (int i = 0; i < 8; ++i) {
    if (store.writes().push(std::to_string(i))) ++written;
    (void)store.step();
  }
  int answered = 0;
  for (int i = 0; i < 16; ++i) {
    while (store.answers().pop()) ++answered;
    (void)store.step();
  }
  EXPECT_EQ(answered, written);
  EXPECT_EQ(text_of(disk, kSettingsFile), std::to_string(written - 1));
}

}  // namespace
}  // namespace nodal::firmware
