// A rig whose takes' disk is full, removed or read-only: the rig goes on, and says what is wrong, in its status and
// once in its log. Takes that begin with the rig.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "firmware/record/recording.h"
#include "protocol/take/documents.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

StandOptions rig_with_disk(bool at_start = false) {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16, .at_start = at_start};
  return options;
}

wire::Reply start_take(TestHost& host) {
  wire::Request request;
  request.mutable_take_start();
  return host.ask(request);
}

wire::Takes takes_of(TestHost& host) {
  wire::Request request;
  request.mutable_take_list();
  return host.ask(request).takes();
}

/// Records a take of two seconds. True: it was recorded.
bool record_a_take(Stand& stand, TestHost& host) {
  if (!start_take(host).has_take()) return false;
  stand.run(Duration::seconds(2));
  wire::Request stop;
  stop.mutable_take_stop();
  return host.ask(stop).has_take();
}

/// A request for the first file of take 1.
wire::Request read_of_take_1() {
  wire::Request request;
  request.mutable_take_read()->set_take(1);
  request.mutable_take_read()->set_file("cam0-0000.mkv");
  return request;
}

/// What the log says of takes.
std::vector<std::string> take_news(Stand& stand) {
  std::vector<std::string> found;
  for (const std::string& sentence : stand.rig->control().take_news()) {
    if (sentence.starts_with("take ") || sentence.find("take_start") != std::string::npos) found.push_back(sentence);
  }
  return found;
}

TEST(TakeDisk, RemovedWhileRecording_TheRigGoesOnAndSaysItOnce) {
  Stand stand(rig_with_disk());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(start_take(host).has_take());
  stand.run(Duration::seconds(2));
  EXPECT_TRUE(host.status().recording().has_take());
  stand.rig->control().take_news();
  stand.takes->unplug();
  stand.run(Duration::seconds(3));
  const wire::RigStatus status = host.status();
  EXPECT_FALSE(status.recording().has_take());
  EXPECT_NE(status.recording().problem().find("the disk is gone"), std::string::npos) << status.recording().problem();
  EXPECT_EQ(take_news(stand), std::vector<std::string>{status.recording().problem()});
  EXPECT_EQ(status.state(), "degraded") << "the lamp shows it";
  EXPECT_EQ(status.problem(), status.recording().problem());
  const std::uint64_t raymaps = status.raymaps();
  stand.run(Duration::seconds(1));
  EXPECT_GT(host.status().raymaps(), raymaps) << "nothing else stops";

  const wire::Reply refused = start_take(host);
  ASSERT_TRUE(refused.has_error());
  EXPECT_EQ(refused.error().code(), static_cast<std::uint32_t>(Errc::kDeviceGone));
  stand.takes->unplug(false);
  EXPECT_TRUE(start_take(host).has_take()) << "it is there again";
  stand.run(Duration::seconds(1));
  EXPECT_EQ(host.status().recording().problem(), "");
}

TEST(TakeDisk, FullWhileRecording_TheTakeEndsAndTheNextIsRefusedUntilThereIsRoom) {
  Stand stand(rig_with_disk());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(start_take(host).has_take());
  stand.run(Duration::seconds(2));
  stand.takes->set_capacity(stand.takes->total_bytes().value() - stand.takes->free_bytes().value() +
                            firmware::Recording::kReserveBytes);
  stand.run(Duration::seconds(2));
  EXPECT_FALSE(host.status().recording().has_take());
  EXPECT_EQ(host.status().recording().problem(),
            "take 1 ended: the disk is full; delete takes (nodal take delete) or change the card");
  ASSERT_EQ(takes_of(host).takes_size(), 1);
  EXPECT_EQ(takes_of(host).takes(0).state(), "complete");
  EXPECT_EQ(takes_of(host).takes(0).ended(), "disk full");
  const wire::Reply refused = start_take(host);
  ASSERT_TRUE(refused.has_error());
  EXPECT_EQ(refused.error().code(), static_cast<std::uint32_t>(Errc::kDiskFull));
  EXPECT_NE(refused.error().message().find("and a take needs at least"), std::string::npos);
  wire::Request remove;
  remove.mutable_take_delete()->set_take(1);
  EXPECT_TRUE(host.ask(remove).has_take());
  stand.takes->set_capacity(std::uint64_t{1} << 40);
  EXPECT_TRUE(start_take(host).has_take());
}

TEST(TakeDisk, StartAtBoot_ATakeBeginsWhenEveryHeadDelivers) {
  Stand stand(rig_with_disk(true));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); }));
  EXPECT_EQ(host.status().recording().take(), 1U);
  stand.run(Duration::seconds(2));
  EXPECT_GT(host.status().recording().sets(), 10U);
  wire::Request stop;
  stop.mutable_take_stop();
  ASSERT_TRUE(host.ask(stop).has_take());
  stand.run(Duration::seconds(3));
  EXPECT_FALSE(host.status().recording().has_take()) << "once";
}

TEST(TakeDisk, StartAtBootAfterAPowerCut_TheTakeBeforeIsFinishedFirst) {
  Stand first(rig_with_disk(true));
  first.run(Duration::seconds(4));
  auto left = first.takes->after_power_loss(3);
  Stand second(rig_with_disk(true), nullptr, std::move(left));
  TestHost& host = second.connect();
  ASSERT_TRUE(second.run_until([&] { return host.status().recording().has_take(); }));
  EXPECT_EQ(host.status().recording().take(), 2U);
  const wire::Takes takes = takes_of(host);
  ASSERT_EQ(takes.takes_size(), 2);
  EXPECT_EQ(takes.takes(0).state(), "complete");
  EXPECT_EQ(takes.takes(0).ended(), "recovered");
  EXPECT_GT(takes.takes(0).sets(), 10U);
}

TEST(TakeDisk, StartAtBootWithoutRoom_IsSaidInTheLogOnceAndInTheStatus) {
  auto small = std::make_unique<hal::sim::SimDisk>(1, firmware::Recording::kReserveBytes);
  Stand stand(rig_with_disk(true), nullptr, std::move(small));
  TestHost& host = stand.connect();
  stand.run(Duration::seconds(6));
  EXPECT_FALSE(host.status().recording().has_take());
  const std::vector<std::string> news = take_news(stand);
  ASSERT_EQ(news.size(), 1U);
  EXPECT_NE(news[0].find("MB free, and a take needs at least"), std::string::npos) << news[0];
  EXPECT_NE(host.status().recording().problem().find("could not start a take: the disk of the takes has"),
            std::string::npos)
      << host.status().recording().problem();
}

TEST(TakeDisk, ASecondStartWhileOneIsRecorded_IsRefusedAndLeavesNoProblemInTheStatus) {
  Stand stand(rig_with_disk(true));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); }));
  wire::Request start;
  start.mutable_take_start();
  EXPECT_TRUE(host.ask(start).has_error());
  stand.run(Duration::seconds(1));
  EXPECT_TRUE(host.status().recording().has_take());
  EXPECT_EQ(host.status().recording().problem(), "");
}

TEST(TakeDisk, StartAtBootIsRefusedAgainAndAgain_ItIsAskedForEverMoreSeldom) {
  auto used_up = std::make_unique<hal::sim::SimDisk>();
  const std::string highest = "18446744073709551615";  // no number is left for a take
  used_up->put(firmware::kNextTakeFile, {reinterpret_cast<const std::uint8_t*>(highest.data()), highest.size()});
  Stand stand(rig_with_disk(true), nullptr, std::move(used_up));
  TestHost& host = stand.connect();
  stand.run(Duration::seconds(40));
  EXPECT_FALSE(host.status().recording().has_take());
  wire::Request log;
  log.mutable_audit_log();
  std::uint64_t asked = 0;
  const wire::Reply reply = host.ask(log);
  for (const wire::AuditEntry& entry : reply.audit_log().entries()) {
    if (entry.what() == "take_start") asked += entry.count();
  }
  EXPECT_GE(asked, 4U);
  EXPECT_LE(asked, 6U) << "after 0, 2, 6, 14 and 30 s";
}

TEST(TakeDisk, StartAtBootAndTheDiskFailsForAWhile_RecordingGoesOnByItself) {
  Stand stand(rig_with_disk(true));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); }));
  stand.run(Duration::seconds(2));
  stand.takes->unplug();
  ASSERT_TRUE(stand.run_until([&] { return !host.status().recording().has_take(); }));
  stand.run(Duration::seconds(5));
  stand.takes->unplug(false);
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); })) << host.status().problem();
  EXPECT_EQ(host.status().recording().take(), 2U);
  EXPECT_EQ(takes_of(host).takes(0).ended(), "recovered");
}

TEST(TakeDisk, StartAtBootAndTheDiskIsFullForAWhile_RecordingGoesOnWhenThereIsRoom) {
  Stand stand(rig_with_disk(true));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); }));
  stand.run(Duration::seconds(2));
  const std::uint64_t all = stand.takes->total_bytes().value();
  stand.takes->set_capacity(all - stand.takes->free_bytes().value() + firmware::Recording::kReserveBytes);
  ASSERT_TRUE(stand.run_until([&] { return !host.status().recording().has_take(); }));
  stand.rig->control().take_news();
  stand.run(Duration::seconds(20));
  EXPECT_FALSE(host.status().recording().has_take());
  EXPECT_TRUE(take_news(stand).empty()) << "it is not tried in vain";
  stand.takes->set_capacity(all);
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); })) << host.status().problem();
  EXPECT_EQ(host.status().recording().take(), 2U);
}

TEST(TakeDisk, StartAtBootAndEjected_NothingIsRecordedOnTheDiskUntilItComesAgain) {
  Stand stand(rig_with_disk(true));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); }));
  stand.run(Duration::seconds(2));
  wire::Request eject;
  eject.mutable_disk_eject();
  const wire::Reply ejected = host.ask(eject);
  ASSERT_TRUE(ejected.has_take()) << ejected.error().message();
  EXPECT_EQ(ejected.take().take(), 1U);
  stand.run(Duration::seconds(20));
  EXPECT_FALSE(host.status().recording().has_take());
  EXPECT_FALSE(stand.takes->claimed());
  stand.takes->unplug();
  stand.run(Duration::seconds(3));
  stand.takes->unplug(false);
  ASSERT_TRUE(stand.run_until([&] { return host.status().recording().has_take(); })) << host.status().problem();
  EXPECT_EQ(host.status().recording().take(), 2U);
  EXPECT_EQ(takes_of(host).takes(0).ended(), "ejected");
}

TEST(TakeDisk, EjectedAndRemoved_TheRigIsNotDegradedAndSaysThatItWasEjectedUntilADiskComes) {
  Stand stand(rig_with_disk());
  TestHost& host = stand.bring_up();
  wire::Request eject;
  eject.mutable_disk_eject();
  ASSERT_TRUE(host.ask(eject).has_take());
  stand.run(Duration::seconds(3));
  for (const bool removed : {false, true}) {
    stand.takes->unplug(removed);
    stand.run(Duration::seconds(3));
    const wire::RigStatus status = host.status();
    EXPECT_EQ(status.state(), "running") << status.problem();
    EXPECT_EQ(status.recording().problem(), "") << removed;
    EXPECT_TRUE(status.recording().ejected()) << removed;
  }
  stand.takes->unplug(false);
  stand.run(Duration::seconds(3));
  EXPECT_FALSE(host.status().recording().ejected()) << "the same disk is there again";
  stand.takes->unplug();
  stand.run(Duration::seconds(3));
  EXPECT_EQ(host.status().state(), "degraded") << "it was not ejected";
}

TEST(TakeDisk, AHostCopiesATake_AnotherMayDeleteItOnlyWhenTheCopyIsDone) {
  Stand stand(rig_with_disk());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(record_a_take(stand, host));
  TestHost& copies = stand.connect();
  ASSERT_TRUE(copies.ask(read_of_take_1()).has_pull());
  wire::Request remove;
  remove.mutable_take_delete()->set_take(1);
  const wire::Reply refused = host.ask(remove);
  ASSERT_TRUE(refused.has_error());
  EXPECT_EQ(refused.error().code(), static_cast<std::uint32_t>(Errc::kBusy));
  EXPECT_NE(refused.error().message().find("take 1 is being copied by host"), std::string::npos)
      << refused.error().message();
  stand.run(Duration::seconds(5));
  EXPECT_TRUE(host.ask(remove).has_error()) << "a host copies a take file by file";
  EXPECT_TRUE(copies.ask(remove).has_take()) << "it may delete what it has copied";
}

TEST(TakeDisk, AHostReadsAKilobyteEveryHalfMinute_ItsStreamGoesOnAndItKeepsNobodyFromDeleting) {
  Stand stand(rig_with_disk());
  TestHost& host = stand.bring_up();
  ASSERT_TRUE(record_a_take(stand, host));
  TestHost& slow = stand.connect();
  slow.link().in().capacity = 1000;
  const auto read_a_kilobyte = [&] {
    slow.reading = true;
    slow.pump();
    slow.reading = false;
  };
  const std::uint64_t id = slow.post(read_of_take_1());
  slow.pump();
  slow.reading = false;
  stand.run(stand.tick);
  read_a_kilobyte();
  ASSERT_NE(slow.reply(id), nullptr);
  ASSERT_TRUE(slow.reply(id)->has_pull());
  wire::Request remove;
  remove.mutable_take_delete()->set_take(1);
  ASSERT_TRUE(host.ask(remove).has_error()) << "it has only begun";
  stand.tick = Duration::milliseconds(20);
  for (int half_minutes = 0; half_minutes < 3; ++half_minutes) {
    stand.run(Duration::seconds(30));
    read_a_kilobyte();
  }
  const auto closed = slow.closed.find(slow.reply(id)->pull().stream());
  ASSERT_EQ(closed, slow.closed.end()) << (closed->second ? closed->second->message : "whole");
  const wire::Reply removed = host.ask(remove);
  EXPECT_TRUE(removed.has_take()) << removed.error().message();
}

}  // namespace
}  // namespace nodal::scenario
