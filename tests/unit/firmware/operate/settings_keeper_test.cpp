#include "firmware/operate/settings_keeper.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

HeadChange gain_of(std::size_t head, std::int32_t mdb) {
  HeadChange change{head_bit(head), {}};
  change.change.gain = Gain::millidecibels(mdb);
  return change;
}

/// A program that keeps settings on a disk; another one after it finds them there.
struct KeptSettings {
  explicit KeptSettings(hal::sim::SimDisk& disk, std::uint8_t rig = 1) : store(disk) {
    Sha256 hash{};
    hash.fill(rig);
    keeper.emplace(store, hash);
    store.step();
    keeper->read(news);
  }
  /// Writes what is due, and takes the result.
  void write(Instant now) {
    keeper->write(now);
    while (store.step()) continue;
    keeper->take_answers(news);
  }
  std::vector<CaptureCommand> restored() {
    std::vector<CaptureCommand> all;
    for (; keeper->next_to_restore(); keeper->restored()) all.push_back(*keeper->next_to_restore());
    return all;
  }

  SettingsStore store;
  News news{Instant()};
  std::optional<SettingsKeeper> keeper;
};

TEST(SettingsKeeper, ARememberedSetting_IsRestoredByTheNextProgram) {
  hal::sim::SimDisk disk;
  KeptSettings first(disk);
  EXPECT_TRUE(first.restored().empty());
  first.keeper->remember(gain_of(2, 6000));
  first.write(Instant());
  EXPECT_EQ(first.keeper->problem(), "");

  KeptSettings second(disk);
  const auto restored = second.restored();
  ASSERT_EQ(restored.size(), 1u);
  const auto& change = std::get<HeadChange>(restored[0]);
  EXPECT_EQ(change.heads, head_bit(2));
  EXPECT_EQ(change.change.gain, Gain::millidecibels(6000));
  EXPECT_EQ(second.news.take(), std::vector<std::string>{"restoring the stored settings"});
}

TEST(SettingsKeeper, SettingsOfAnotherRigToml_AreNotRestoredAndNoProblem) {
  hal::sim::SimDisk disk;
  KeptSettings first(disk);
  first.keeper->remember(gain_of(2, 6000));
  first.write(Instant());
  KeptSettings other(disk, 2);
  EXPECT_TRUE(other.restored().empty());
  EXPECT_EQ(other.news.take().size(), 1u) << "the reason";
  EXPECT_EQ(other.keeper->problem(), "");
}

TEST(SettingsKeeper, AFileThatIsNoSettings_IsAProblemUntilItIsReplaced) {
  hal::sim::SimDisk disk;
  const std::string nonsense = "nonsense";
  disk.put(kSettingsFile, std::span(reinterpret_cast<const std::uint8_t*>(nonsense.data()), nonsense.size()));
  KeptSettings kept(disk);
  EXPECT_TRUE(kept.restored().empty());
  EXPECT_NE(kept.keeper->problem(), "");
  kept.keeper->remember(gain_of(0, 0));
  kept.write(Instant());
  EXPECT_EQ(kept.keeper->problem(), "");
}

TEST(SettingsKeeper, TheDiskFails_IsSaidOnceAndSoIsItsReturn) {
  hal::sim::SimDisk disk;
  KeptSettings kept(disk);
  disk.be_read_only(true);
  for (int second = 0; second < 40; ++second) {
    kept.keeper->remember(gain_of(0, second));
    kept.write(Instant() + Duration::seconds(second));
  }
  EXPECT_EQ(kept.news.take().size(), 1u);
  EXPECT_NE(kept.keeper->problem(), "");
  disk.be_read_only(false);
  kept.write(Instant() + Duration::seconds(60));
  EXPECT_EQ(kept.news.take(), std::vector<std::string>{"settings are stored again"});
  EXPECT_EQ(kept.keeper->problem(), "");
}

}  // namespace
}  // namespace nodal::firmware
