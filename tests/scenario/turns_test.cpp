// What only one host can have at a time: everybody gets it in turn, and queries do not wait for it.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <ranges>
#include <vector>

#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/stream_progress.h"
#include "protocol/take/evidence.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr Duration kExclusiveWithin = Duration::seconds(10);
constexpr std::size_t kControlHosts = firmware::Admission::kMaxClients;

StandOptions rig_with_takes() {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16};
  return options;
}

wire::Request frame_set() {
  wire::Request request;
  request.mutable_frame_set();
  return request;
}

/// Asks for a frame set and waits until it has come, counted from the question.
testing::AssertionResult gets_a_frame_set(Stand& stand, TestHost& host, Duration within) {
  const Instant asked = stand.world.clock().now();
  const std::uint64_t id = host.post(frame_set());
  if (!stand.run_until([&] { return host.reply(id) != nullptr || host.dead(); }, within))
    return testing::AssertionFailure() << "no answer";
  if (host.dead()) return testing::AssertionFailure() << "closed: " << host.farewell()->message;
  if (!host.reply(id)->has_pull()) return testing::AssertionFailure() << host.reply(id)->error().message();
  const StreamId stream = host.reply(id)->pull().stream();
  const Duration left = within - (stand.world.clock().now() - asked);
  if (!stand.run_until([&] { return host.closed.contains(stream); }, left))
    return testing::AssertionFailure() << "the set does not come";
  if (host.closed[stream]) return testing::AssertionFailure() << host.closed[stream]->message;
  return testing::AssertionSuccess() << "after " << (stand.world.clock().now() - asked).ms() << " ms";
}

/// Asks for frame sets and never reads one.
void occupy_frame_sets(TestHost& host) {
  host.link().in().capacity = 1000;
  host.post(frame_set());
  host.pump();
  host.reading = false;
}

TEST(FrameSetTurns, EveryPlaceOfTheViewSocketIsTakenByHostsThatReadNothing_ControlAndViewGetASet) {
  Stand stand;
  TestHost& honest = stand.bring_up();
  for (std::size_t i = 1; i < kControlHosts / 2; ++i) occupy_frame_sets(stand.connect_to_view());
  stand.run(Duration::milliseconds(200));
  EXPECT_TRUE(gets_a_frame_set(stand, honest, kExclusiveWithin));
  EXPECT_TRUE(gets_a_frame_set(stand, stand.connect_to_view(), kExclusiveWithin));
}

TEST(FrameSetTurns, ManyHostsOfTheSameUserReadNothing_AnotherGetsASet) {
  Stand stand;
  TestHost& honest = stand.bring_up();
  for (std::size_t i = 1; i < kControlHosts; ++i) occupy_frame_sets(stand.connect());
  stand.run(Duration::milliseconds(200));
  EXPECT_TRUE(gets_a_frame_set(stand, honest, kExclusiveWithin));
}

TEST(FrameSetTurns, HostsAskAgainAndAgain_EverybodyGetsSetsAndNobodyIsRefused) {
  Stand stand;
  std::vector<TestHost*> hosts{&stand.bring_up()};
  for (int i = 0; i < 4; ++i) hosts.push_back(&stand.connect());
  std::vector<std::uint64_t> asked(hosts.size());
  std::vector<int> got(hosts.size());
  for (std::size_t i = 0; i < hosts.size(); ++i) asked[i] = hosts[i]->post(frame_set());
  const auto turn = [&] {
    for (std::size_t i = 0; i < hosts.size(); ++i) {
      const wire::Reply* reply = hosts[i]->reply(asked[i]);
      if (!reply) continue;
      EXPECT_TRUE(reply->has_pull()) << reply->error().message();
      if (!hosts[i]->closed.contains(reply->pull().stream())) continue;
      EXPECT_FALSE(hosts[i]->closed[reply->pull().stream()]);
      ++got[i];
      asked[i] = hosts[i]->post(frame_set());
    }
    return std::ranges::min(got) >= 10;
  };
  EXPECT_TRUE(stand.run_until(turn, Duration::seconds(20)));
  EXPECT_LE(std::ranges::max(got), std::ranges::min(got) + 5);
}

TEST(FrameSetTurns, ASlowControlHost_KeepsItsSetWhileViewOnlyHostsWaitForLessThanItsShare) {
  Stand stand;
  TestHost& slow = stand.bring_up();
  for (int i = 0; i < 6; ++i) occupy_frame_sets(stand.connect_to_view());
  stand.run(Duration::seconds(3));
  slow.link().in().capacity = 500;  // 500 bytes a millisecond: about 0.15 s for the set
  EXPECT_TRUE(gets_a_frame_set(stand, slow, kExclusiveWithin));
}

/// Has sent the document of an installation that is not committed yet.
wire::Request installation_of(Stand& stand, TestHost& host, const std::string& name) {
  const std::string document = to_json(small_calibration(name));
  host.send_document(document);
  stand.run(Duration::milliseconds(20));
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request commit;
  *commit.mutable_upload_commit() = UploadSender(bytes).commit();
  return commit;
}

TEST(CalibrationTurns, SeveralHostsInstall_AListIsAnsweredBeforeAnyOfThemAndAllAreInstalledInTurn) {
  Stand stand;
  TestHost& honest = stand.bring_up();
  std::vector<TestHost*> others;
  std::vector<wire::Request> prepared;
  for (int i = 0; i < 3; ++i) {
    others.push_back(&stand.connect());
    prepared.push_back(installation_of(stand, *others.back(), "number " + std::to_string(i)));
  }
  std::vector<std::uint64_t> commits;
  for (std::size_t i = 0; i < 3; ++i) commits.push_back(others[i]->post(prepared[i]));
  wire::Request list;
  list.mutable_calibration_list();
  std::optional<std::uint64_t> asked;
  const auto done = [&] {
    return std::ranges::count_if(std::views::iota(0, 3), [&](int i) {
      return others[std::size_t(i)]->reply(commits[std::size_t(i)]) != nullptr;
    });
  };
  // Single steps, because the stand otherwise installs everything within no time.
  for (int step = 0; step < 5000 && (!asked || !honest.reply(*asked)); ++step) {
    stand.rig->step_control();
    stand.rig->step_keeper();
    for (const auto& host : stand.hosts) host->pump();
    if (step == 3) asked = honest.post(list);
  }
  ASSERT_TRUE(honest.reply(*asked));
  EXPECT_TRUE(honest.reply(*asked)->has_calibrations());
  EXPECT_EQ(done(), 0) << "the list did not wait for a calibration";
  ASSERT_TRUE(stand.run_until([&] { return done() == 3; }));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(others[std::size_t(i)]->reply(commits[std::size_t(i)])->has_done()) << i;
}

class TakeTurns : public testing::Test {
 protected:
  Stand stand{rig_with_takes()};
  TestHost& host{stand.bring_up()};

  void record(Duration length) {
    wire::Request start, stop;
    start.mutable_take_start();
    stop.mutable_take_stop();
    EXPECT_TRUE(host.ask(start).has_take());
    stand.run(length);
    EXPECT_TRUE(host.ask(stop).has_take());
  }
  static wire::Request read(const std::string& file) {
    wire::Request request;
    request.mutable_take_read()->set_take(1);
    request.mutable_take_read()->set_file(file);
    return request;
  }
  std::size_t bytes_of(const std::string& file) {
    return stand.takes->size(take::take_folder(1) + "/" + file).value_or(0);
  }
};

TEST_F(TakeTurns, EveryOtherPlaceIsTakenByHostsThatReadNothing_AFileIsReadAtOnce) {
  record(Duration::seconds(3));
  for (std::size_t i = 1; i < kControlHosts; ++i) {
    TestHost& stuck = stand.connect();
    stuck.link().in().capacity = 1000;
    stuck.post(read("cam0-0000.mkv"));
    stuck.pump();
    stuck.reading = false;
  }
  stand.run(Duration::milliseconds(200));
  const wire::Reply reply = host.ask(read("cam1-0000.mkv"));
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  const StreamId stream = reply.pull().stream();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }, Duration::seconds(2)));
  EXPECT_FALSE(host.closed[stream]);
  std::size_t bytes = 0;
  for (const Pulled& piece : host.pulled[stream]) bytes += piece.body.size();
  EXPECT_EQ(bytes, bytes_of("cam1-0000.mkv"));
}

/// A kilobyte a second: a bulk piece of 64 KiB takes longer than kLongestPause.
TEST_F(TakeTurns, AHostReadsAKilobyteASecond_GetsItsFileAndOneThatReadsNothingIsEndedWithTheReason) {
  record(Duration::seconds(3));
  TestHost& stuck = stand.connect();
  for (TestHost* each : {&host, &stuck}) each->link().in().capacity = 1000;
  const std::uint64_t asked = host.post(read("cam0-0000.mkv"));
  const std::uint64_t never_read = stuck.post(read("cam0-0000.mkv"));
  for (TestHost* each : {&host, &stuck}) each->pump();
  stuck.reading = false;
  const std::uint64_t before = host.link().in().written;
  for (Duration slow; slow < firmware::StreamProgress::kLongestPause * 2; slow = slow + Duration::seconds(1)) {
    host.reading = false;
    stand.run(Duration::seconds(1));
    host.reading = true;
    host.pump();
  }
  ASSERT_LT(host.link().in().written - before, 2 * kMaxPieceBytes) << "the link was not slow";
  for (TestHost* each : {&host, &stuck}) each->link().in().capacity = 256U << 10;
  stuck.reading = true;
  ASSERT_TRUE(host.reply(asked) && host.reply(asked)->has_pull());
  const StreamId stream = host.reply(asked)->pull().stream();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream) && !stuck.closed.empty(); }));
  EXPECT_FALSE(host.closed[stream]) << host.closed[stream]->message;
  std::size_t bytes = 0;
  for (const Pulled& piece : host.pulled[stream]) bytes += piece.body.size();
  EXPECT_EQ(bytes, bytes_of("cam0-0000.mkv"));
  const auto& ended = stuck.closed[stuck.reply(never_read)->pull().stream()];
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->code, Errc::kTimeout);
  EXPECT_EQ(ended->message, "this host has read nothing of the file for 60 s");
}

TEST_F(TakeTurns, TwoHostsReadTheSameFile_BothGetAllOfIt) {
  record(Duration::seconds(3));
  TestHost& other = stand.connect();
  const std::uint64_t mine = host.post(read("cam0-0000.mkv"));
  const std::uint64_t theirs = other.post(read("cam0-0000.mkv"));
  const auto whole = [&](TestHost& one, std::uint64_t id) {
    return one.reply(id) && one.reply(id)->has_pull() && one.closed.contains(one.reply(id)->pull().stream());
  };
  ASSERT_TRUE(stand.run_until([&] { return whole(host, mine) && whole(other, theirs); }));
  for (const auto& [one, id] : {std::pair{&host, mine}, std::pair{&other, theirs}}) {
    std::size_t bytes = 0;
    for (const Pulled& piece : one->pulled[one->reply(id)->pull().stream()]) bytes += piece.body.size();
    EXPECT_EQ(bytes, bytes_of("cam0-0000.mkv"));
  }
}

TEST_F(TakeTurns, AHostIsUnpluggedInItsCopy_TheOthersCopyGoesOn) {
  record(Duration::seconds(3));
  TestHost& other = stand.connect();
  host.link().in().capacity = 1000;
  host.post(read("cam0-0000.mkv"));
  host.pump();
  host.reading = false;
  stand.run(Duration::milliseconds(200));
  host.link().reset();
  stand.run(Duration::milliseconds(200));
  const wire::Reply reply = other.ask(read("cam0-0000.mkv"));
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  ASSERT_TRUE(stand.run_until([&] { return other.closed.contains(reply.pull().stream()); }));
  EXPECT_FALSE(other.closed[reply.pull().stream()]);
}

wire::Request disk_test(std::int64_t seconds) {
  wire::Request request;
  request.mutable_disk_test()->set_length_ns(static_cast<std::uint64_t>(Duration::seconds(seconds).ns()));
  return request;
}

TEST_F(TakeTurns, TheDiskIsBeingTestedForAMinute_AnotherHostsTestIsAnsweredByItWithinTenSeconds) {
  stand.takes->set_speed(&stand.world.clock(), 40'000'000);
  TestHost& greedy = stand.connect();
  stand.run(Duration::milliseconds(10));
  const std::uint64_t minute = greedy.post(disk_test(60));
  greedy.pump();
  stand.rig->step_control();
  stand.rig->step_takes();
  const Instant asked = stand.world.clock().now();
  const std::uint64_t id = host.post(disk_test(5));
  ASSERT_TRUE(stand.run_until([&] { return host.reply(id) && greedy.reply(minute); }));
  EXPECT_LE(stand.world.clock().now() - asked, kExclusiveWithin + Duration::seconds(1));
  ASSERT_TRUE(host.reply(id)->has_disk_test()) << host.reply(id)->error().message();
  EXPECT_GE(host.reply(id)->disk_test().took_ns(), 10'000'000'000u) << "the first host's test is not cut below this";
  EXPECT_EQ(host.reply(id)->disk_test().bytes(), greedy.reply(minute)->disk_test().bytes());
}

wire::Request protect() {
  wire::Request request;
  request.mutable_take_protect()->set_take(1);
  request.mutable_take_protect()->set_on(true);
  return request;
}

/// Hosts that connect, ask and are gone, again and again, in the places that others leave.
void ask_and_leave(Stand& stand, const wire::Request& request, int rounds, const std::function<void()>& step) {
  for (int round = 0; round < rounds; ++round) {
    std::vector<TestHost*> hosts;
    for (std::size_t i = 1; i < kControlHosts; ++i) hosts.push_back(&stand.connect());
    for (int k = 0; k < 4; ++k) {
      for (TestHost* host : hosts) host->pump();
      stand.rig->step_control();
    }
    for (TestHost* host : hosts) host->post(request);
    for (TestHost* host : hosts) host->pump();
    step();
    for (TestHost* host : hosts) host->link().reset();
    stand.rig->step_control();
  }
}

TEST_F(TakeTurns, HostsAskForTestsOfTheDiskAndAreGone_TheOneThatStaysGetsTheResult) {
  stand.takes->set_speed(&stand.world.clock(), 40'000'000);
  const Instant asked = stand.world.clock().now();
  const std::uint64_t id = host.post(disk_test(5));
  host.pump();
  stand.rig->step_control();
  stand.rig->step_takes();
  ask_and_leave(stand, disk_test(60), 10, [&] {
    stand.rig->step_control();
    stand.rig->step_takes();
  });
  ASSERT_TRUE(stand.run_until([&] { return host.reply(id) != nullptr; }));
  EXPECT_TRUE(host.reply(id)->has_disk_test()) << host.reply(id)->error().message();
  EXPECT_LE(stand.world.clock().now() - asked, kExclusiveWithin + Duration::seconds(1));
}

/// As while one operation of a slow disk lasts.
TEST_F(TakeTurns, TheTakesStageStandsStillAndItsQueueIsFullOfRequestsOfHostsThatAreGone_ARequestWaitsAndIsAnswered) {
  record(Duration::seconds(1));
  ask_and_leave(stand, protect(), 10, [&] { stand.rig->step_control(); });
  const std::uint64_t id = host.post(disk_test(1));
  for (int k = 0; k < 10; ++k) {
    host.pump();
    stand.rig->step_control();
  }
  EXPECT_EQ(host.reply(id), nullptr) << "it is not refused: " << host.reply(id)->error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.reply(id) != nullptr; }));
  EXPECT_TRUE(host.reply(id)->has_disk_test()) << host.reply(id)->error().message();
}

}  // namespace
}  // namespace nodal::scenario
