// The audit log in virtual time: which entries are merged and for how long, which are asked for, and when changes must
// wait.
#include "firmware/operate/audit_log.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

/// A log and its store on a disk, at a time that the test sets.
struct LogWorld {
  LogWorld() { step(); }
  AuditLog::Receipt record(const std::string& after, const std::string& party = "user 1", bool important = false) {
    AuditEntry entry;
    entry.who = party;
    entry.what = "head_set";
    entry.before = "before";
    entry.after = after;
    return log.record(std::move(entry), party, important, now);
  }
  /// Both exchange all that they have.
  void step() {
    for (int idle = 0; idle < 3;) {
      const bool wrote = store.step(now);
      const bool changed = log.step(now);
      idle = wrote || changed ? 0 : idle + 1;
    }
  }
  void wait(Duration time) {
    now = now + time;
    utc_ns += time.ns();
    step();
  }
  std::vector<std::string> after(std::uint64_t number, std::int64_t since_utc_ns = 0) {
    std::vector<std::string> texts;
    for (const AuditEntry& entry : log.entries(number, since_utc_ns)) texts.push_back(entry.after);
    return texts;
  }

  hal::sim::SimDisk disk;
  Instant now;
  std::int64_t utc_ns = 1'700'000'000'000'000'000;
  AuditStore store{disk};
  AuditLog log{store, [this] { return utc_ns; }};
};

using Texts = std::vector<std::string>;

TEST(AuditLog, EntriesAreAskedFor_AreThoseAfterANumberAndSinceATime) {
  LogWorld world;
  const std::int64_t begin = world.utc_ns;
  for (const char* text : {"a", "b", "c"}) {
    world.record(text);
    world.wait(Duration::seconds(10));
  }
  EXPECT_EQ(world.after(0), (Texts{"a", "b", "c"}));
  EXPECT_EQ(world.after(1), (Texts{"b", "c"}));
  EXPECT_EQ(world.after(3), Texts());
  EXPECT_EQ(world.after(0, begin + 10'000'000'000), (Texts{"b", "c"}));
  EXPECT_EQ(world.after(0, begin + 10'000'000'001), Texts{"c"});
  EXPECT_EQ(world.after(2, begin), Texts{"c"}) << "both";
  EXPECT_EQ(world.log.oldest(), 1U);
  EXPECT_EQ(world.log.newest(), 3U);
}

TEST(AuditLog, WhatRepeats_IsOneEntryAtTheEndOfItsWindowWithAllOfThem) {
  LogWorld world;
  for (int k = 0; k < 5; ++k) world.record("same");
  world.step();
  std::vector<AuditEntry> entries = world.log.entries(0, 0);
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[1].number, 0U) << "its window is open";
  EXPECT_EQ(entries[1].count, 4U);
  world.wait(AuditLog::kFirstWindow - Duration::nanoseconds(1));
  EXPECT_EQ(world.log.newest(), 1U);
  world.wait(Duration::nanoseconds(1));
  EXPECT_EQ(world.log.newest(), 2U);
  entries = world.log.entries(0, 0);
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[1].number, 2U);
  EXPECT_EQ(entries[1].count, 4U);
}

TEST(AuditLog, NodaldStartsAgain_EntriesAreThoseOfBothRuns) {
  LogWorld first;
  for (const char* text : {"a", "b"}) first.record(text);
  first.step();
  AuditStore store(first.disk);
  store.step({});
  AuditLog log(store, [] { return std::int64_t{0}; });
  log.step({});
  ASSERT_TRUE(log.loaded());
  const std::vector<AuditEntry> entries = log.entries(0, 0);
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0].after, "a");
  EXPECT_EQ(entries[1].after, "b");
  EXPECT_EQ(entries[1].number, 2U);
  EXPECT_FALSE(entries[1].at);
}

TEST(AuditLog, TheDiskTakesNoEntry_ItIsFullAfterItsLimitAndNothingIsLostWhenItDoes) {
  LogWorld world;
  world.disk.be_read_only();
  std::uint64_t recorded = 0;
  for (int party = 0; !world.log.full(); ++party) {
    ASSERT_LT(party, 1000);
    world.record("x", "user " + std::to_string(party));
    world.step();
    ++recorded;
  }
  EXPECT_NE(world.log.problem(), "");
  EXPECT_GE(recorded, AuditLog::kMaxFresh);
  world.disk.be_read_only(false);
  world.wait(AuditStore::kRetryEvery);
  EXPECT_FALSE(world.log.full());
  EXPECT_EQ(world.log.problem(), "");
  EXPECT_EQ(world.log.newest(), recorded);
}

TEST(AuditLog, AnImportantChange_HasItsEntryAndIsSettledOnceItIsOnTheDisk) {
  LogWorld world;
  const AuditLog::Receipt receipt = world.record("calibration", "user 1", true);
  ASSERT_NE(receipt, 0U);
  EXPECT_FALSE(world.log.settled(receipt));
  world.step();
  EXPECT_TRUE(world.log.settled(receipt));
  for (std::uint32_t k = 1; k < AuditLog::kImportantBurst; ++k) {
    EXPECT_TRUE(world.log.may_change("user 1", world.now)) << k;
    world.record("calibration", "user 1", true);
    world.step();
  }
  EXPECT_FALSE(world.log.may_change("user 1", world.now));
  EXPECT_TRUE(world.log.may_change("user 2", world.now));
  world.wait(AuditLog::kImportantEvery);
  EXPECT_TRUE(world.log.may_change("user 1", world.now));
  EXPECT_EQ(world.log.newest(), AuditLog::kImportantBurst) << "none is merged";
}

}  // namespace
}  // namespace nodal::firmware
