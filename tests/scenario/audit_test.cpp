// The audit log of a whole rig: what is in it, what it survives, and that no flood hides a change.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "firmware/storage/audit_store.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

wire::AuditLog audit_log_of(TestHost& host) {
  wire::Request request;
  request.mutable_audit_log();
  return host.ask(request).audit_log();
}

/// All entries that are stored, in as many replies as it takes.
std::vector<wire::AuditEntry> all_of(TestHost& host) {
  std::vector<wire::AuditEntry> all;
  wire::Request request;
  request.mutable_audit_log()->set_after(0);
  for (bool more = true; more;) {
    const wire::AuditLog part = host.ask(request).audit_log();
    for (const wire::AuditEntry& entry : part.entries()) {
      if (entry.number() != 0) request.mutable_audit_log()->set_after(entry.number());
      all.push_back(entry);
    }
    more = part.more();
  }
  return all;
}

bool has(const std::vector<wire::AuditEntry>& log, const std::string& what, const std::string& after) {
  return std::ranges::any_of(log, [&](const wire::AuditEntry& entry) {
    return entry.what() == what && entry.after().find(after) != std::string::npos && !entry.has_error();
  });
}

wire::Request exposures_of_all(std::uint64_t ns) {
  wire::Request request;
  request.mutable_head_set()->set_exposure_ns(ns);
  return request;
}

TEST(AuditOfARig, AFloodOfSettings_IsMergedAndTheCalibrationBeforeItStays) {
  Stand stand;
  TestHost& host = stand.bring_up();
  TestHost& greedy = stand.connect({1001, 1});
  for (std::uint64_t i = 0; i < 3000; ++i) greedy.ask(exposures_of_all(1'000'000 + i * 1000));
  const std::vector<wire::AuditEntry> log = all_of(host);
  EXPECT_TRUE(has(log, "upload_commit", "calibration "));
  EXPECT_LE(log.size(), 40u);
  EXPECT_EQ(log.back().number(), 0u) << "merged, and its window is open";
  EXPECT_NE(log.back().after().find("3999000"), std::string::npos) << "the newest value";
  std::uint64_t changes = 0;
  for (const wire::AuditEntry& entry : log) changes += entry.what() == "head_set" ? entry.count() : 0;
  EXPECT_EQ(changes, 3000u) << "none is lost";
  const std::size_t size = stand.disk->size(firmware::kAuditFile).value_or(0);
  EXPECT_LE(size, 20'000u);
  // One that another user makes has its own entry.
  host.ask(exposures_of_all(7'000'000));
  EXPECT_TRUE(has(all_of(host), "head_set", "exposure 7000000 ns"));
}

TEST(AuditOfARig, ThePowerGoesAfterTheAnswer_CalibrationAndEndOfAHostAreInTheLog) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    Stand stand;
    TestHost& host = stand.bring_up();
    stand.connect({1001, 77});
    stand.run(Duration::milliseconds(10));
    wire::Request end;
    end.mutable_host_end()->set_number(2);
    ASSERT_TRUE(host.ask(end).has_done());
    Stand again({}, stand.disk->after_power_loss(seed));
    TestHost& other = again.connect();
    const std::vector<wire::AuditEntry> log = all_of(other);
    ASSERT_GE(log.size(), 2u);
    EXPECT_EQ(log[0].what(), "upload_commit");
    EXPECT_TRUE(log[0].earlier_run());
    EXPECT_EQ(log[1].what(), "host_end");
    EXPECT_NE(log[1].before().find("user 1001, process 77"), std::string::npos) << log[1].before();
    EXPECT_EQ(log[1].number(), log[0].number() + 1);
  }
}

TEST(AuditOfARig, AReadOfATake_IsRecordedOnceHoweverManyFilesItHas) {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16};
  Stand stand(options);
  TestHost& host = stand.bring_up();
  wire::Request start, stop;
  start.mutable_take_start();
  stop.mutable_take_stop();
  ASSERT_TRUE(host.ask(start).has_take());
  stand.run(Duration::seconds(1));
  ASSERT_TRUE(host.ask(stop).has_take());
  for (int i = 0; i < 5; ++i) {
    wire::Request read;
    read.mutable_take_read()->set_take(1);
    read.mutable_take_read()->set_file("manifest");
    const wire::Reply reply = host.ask(read);
    ASSERT_TRUE(reply.has_pull());
    ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); }));
  }
  std::uint64_t reads = 0;
  std::size_t entries = 0;
  for (const wire::AuditEntry& entry : all_of(host)) {
    if (entry.what() != "take_read") continue;
    ++entries;
    reads += entry.count();
    EXPECT_EQ(entry.after(), "take 1 is read");
  }
  EXPECT_EQ(reads, 5u);
  EXPECT_EQ(entries, 2u) << "the first, and the others together";
}

TEST(AuditOfARig, TheDiskTakesNoEntry_TheReplyAndTheStateSayItAndLaterItIsWritten) {
  Stand stand;
  TestHost& host = stand.bring_up();
  TestHost& other = stand.connect();
  stand.run(Duration::milliseconds(10));
  EXPECT_FALSE(other.dead());
  stand.disk->be_read_only();
  wire::Request end;
  end.mutable_host_end()->set_number(2);
  const wire::Reply reply = host.ask(end);
  ASSERT_TRUE(reply.has_done());
  EXPECT_NE(reply.not_recorded().find("audit log: "), std::string::npos) << reply.not_recorded();
  EXPECT_TRUE(stand.run_until([&] { return host.status().problem().find("audit log: ") == 0; }))
      << host.status().problem();
  EXPECT_NE(audit_log_of(host).problem(), "");
  stand.disk->be_read_only(false);
  ASSERT_TRUE(stand.run_until([&] { return audit_log_of(host).problem().empty(); }));
  EXPECT_EQ(audit_log_of(host).newest(), 2u);
}

/// The n-th of many changes of different kinds, of which every third is refused.
wire::Request nth_change(std::uint64_t n) {
  wire::Request request;
  if (n % 3 == 0) request.mutable_exposure()->set_target_below(static_cast<std::uint32_t>(1000 + n));
  else request.mutable_head_set()->set_exposure_ns(1'000'000 + n * 1000);
  if (n % 3 == 1) request.mutable_head_set()->add_heads(static_cast<std::uint32_t>(90 + n));
  return request;
}

TEST(AuditOfARig, TheDiskTakesNoEntryForLong_ChangesWaitInsteadOfBeingLeftOut) {
  Stand stand;
  stand.run(Duration::milliseconds(10));
  stand.disk->be_read_only();
  constexpr std::uint64_t kChanges = 3 * firmware::AuditLog::kBurst;
  struct User {
    TestHost* host = nullptr;
    std::vector<std::uint64_t> asked;
  };
  std::vector<User> users;
  for (std::uint32_t id = 0; id < firmware::Admission::kMaxClients - 1; ++id) {
    users.push_back({&stand.connect({2000 + id, 1}), {}});
    stand.run(Duration::milliseconds(5));
    for (std::uint64_t n = 0; n < kChanges; ++n) users.back().asked.push_back(users.back().host->post(nth_change(n)));
  }
  const auto answered = [&] {
    std::size_t count = 0;
    for (const User& user : users) {
      count += static_cast<std::size_t>(
          std::ranges::count_if(user.asked, [&](std::uint64_t id) { return user.host->reply(id) != nullptr; }));
    }
    return count;
  };
  stand.run(Duration::seconds(20));
  EXPECT_LT(answered(), users.size() * kChanges) << "more than the log holds must wait";
  EXPECT_GE(answered(), firmware::AuditLog::kMaxFresh);
  stand.disk->be_read_only(false);
  ASSERT_TRUE(stand.run_until([&] { return answered() == users.size() * kChanges; }, Duration::seconds(60)));
  std::uint64_t changes = 0;
  std::uint64_t number = 0;
  for (const wire::AuditEntry& entry : all_of(*users[0].host)) {
    changes += entry.count();
    if (entry.number() != 0) {
      EXPECT_EQ(entry.number(), ++number) << "without a gap";
    }
  }
  EXPECT_EQ(changes, users.size() * kChanges);
}

TEST(AuditOfARig, AUserChangesCalibrationsWithoutAPause_EachHasItsEntryAndFurtherOnesWait) {
  Stand stand;
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(host.upload(to_json(small_calibration("second"))).has_done());
  wire::Request back;
  back.mutable_calibration_rollback();
  for (std::uint32_t i = 2; i < firmware::AuditLog::kImportantBurst; ++i) ASSERT_TRUE(host.ask(back).has_done()) << i;
  const Instant before = stand.world.clock().now();
  EXPECT_TRUE(host.ask(back).has_done());
  EXPECT_GE(stand.world.clock().now() - before, Duration::seconds(1));
  std::size_t entries = 0;
  for (const wire::AuditEntry& entry : all_of(host)) entries += entry.what() == "calibration_rollback" ? 1 : 0;
  EXPECT_EQ(entries, std::size_t{firmware::AuditLog::kImportantBurst} - 1);
}

}  // namespace
}  // namespace nodal::scenario
