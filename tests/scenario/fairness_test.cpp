// Many hosts, some of them greedy, silent or slow: the others are served.
#include <gtest/gtest.h>

#include <array>
#include <span>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

/// Whether the raymaps are of consecutive sets.
bool without_gap(const std::vector<Pulled>& raymaps) {
  for (std::size_t i = 1; i < raymaps.size(); ++i) {
    if (raymaps[i].header.set() != raymaps[i - 1].header.set() + 1) return false;
  }
  return true;
}

wire::Hosts list_hosts(TestHost& host) {
  wire::Request request;
  request.mutable_hosts();
  return host.ask(request).hosts();
}

/// Reads the available bytes every 5 s, like a host with a slow disk.
TEST(Hosts, ALosslessPullThatReadsEveryFiveSeconds_CostsNobodyASetAndIsEndedWithAReason) {
  Stand stand;
  TestHost& slow = stand.bring_up();
  TestHost& other = stand.connect();
  const StreamId live = other.pull(false, 0);
  const StreamId stream = slow.pull(false, 0, true);
  slow.link().in().capacity = 1000;  // pending bytes stay on the rig
  for (int i = 0; i < 6; ++i) {
    slow.reading = false;
    stand.run(Duration::seconds(5));
    EXPECT_EQ(stand.state(), "running") << other.status().problem();
    slow.reading = true;
    stand.run(Duration::milliseconds(100));
    if (slow.closed.contains(stream) && i < 5) (void)slow.pull(false, 0, true);  // it tries again
  }
  EXPECT_EQ(stand.rig->control().sets_missed_by_blend(), 0u);
  EXPECT_EQ(stand.rig->blender().counts().without_buffer.load(), 0u);
  EXPECT_GE(other.pulled[live].size(), 30u * 30u) << "30.6 s at 29.97 a second";
  EXPECT_TRUE(without_gap(other.pulled[live]));
  ASSERT_TRUE(slow.closed.contains(stream));
  ASSERT_TRUE(slow.closed[stream]);
  EXPECT_EQ(slow.closed[stream]->code, Errc::kTimeout);
  EXPECT_NE(slow.closed[stream]->message.find("too slow"), std::string::npos);
  EXPECT_TRUE(without_gap(slow.pulled[stream]));
  const wire::Hosts hosts = list_hosts(other);
  EXPECT_EQ(hosts.hosts(0).streams(hosts.hosts(0).streams_size() - 1), "was too slow for 6 lossless pulls");
  EXPECT_NE(other.status().publish_drops(0).reason().find("host 1"), std::string::npos);
}

TEST(Publisher, WhatMayWaitForALosslessPull_IsBoundedByRaymapsAndByBytes) {
  using firmware::Publisher;
  EXPECT_EQ(Publisher::most_pending(0), kLosslessQueueItems);
  EXPECT_EQ(Publisher::most_pending(600'000), kLosslessQueueItems) << "JPEGs of ten heads";
  EXPECT_EQ(Publisher::most_pending(3U << 20), 8u) << "their pixels: 24 MiB";
  EXPECT_EQ(Publisher::most_pending(SIZE_MAX), Publisher::kLosslessMin);
}

TEST(Hosts, StuckOnesThatPullAsOftenAsTheyMay_LeaveBuffersForTheOthers) {
  Stand stand;
  TestHost& good = stand.bring_up();
  const StreamId live = good.pull(false, 0);
  int pulls = 0;
  for (int i = 0; i < 6; ++i) {
    TestHost& stuck = stand.connect();
    for (std::size_t k = 0; k < firmware::Publisher::kMaxPulls; ++k) {
      pulls += stuck.pull(false, 0) != 0 ? 1 : 0;
      stand.run(Duration::milliseconds(700));  // each stops at a different raymap
    }
    stuck.reading = false;
    stuck.link().in().capacity = 1000;
  }
  EXPECT_EQ(pulls, 6 + static_cast<int>(firmware::Publisher::kMaxExtraPulls)) << "one each, and what is shared";
  EXPECT_NE(stand.connect().pull(false, 1), 0u) << "a host's first pull is never refused because of others'";
  stand.run(Duration::seconds(2));
  const std::size_t had = good.pulled[live].size();
  stand.run(Duration::seconds(2));
  EXPECT_GE(good.pulled[live].size(), had + 58);
  EXPECT_EQ(stand.rig->blender().counts().without_buffer.load(), 0u);
}

TEST(Hosts, OneSaysNothing_ItIsClosedSoon) {
  Stand stand;
  auto silent = stand.listener.connect();
  stand.run(Duration::milliseconds(1900));
  EXPECT_EQ(stand.rig->control().clients(), 1u);
  stand.run(Duration::milliseconds(300));
  EXPECT_EQ(stand.rig->control().clients(), 0u);
}

constexpr std::size_t kMaxHosts = firmware::Admission::kMaxClients;

TEST(Hosts, MoreThanARigTalksTo_TheOneIdleLongestMakesRoom) {
  Stand stand;
  for (std::size_t i = 0; i < kMaxHosts; ++i) {
    stand.connect();
    stand.run(Duration::milliseconds(10));
  }
  TestHost& first = *stand.hosts.front();
  EXPECT_EQ(first.status().state(), "no-calibration");  // now the second is idle longest
  stand.run(Duration::milliseconds(10));
  EXPECT_EQ(stand.connect().status().state(), "no-calibration");
  stand.run(Duration::milliseconds(10));
  EXPECT_FALSE(first.dead());
  ASSERT_NE(stand.hosts[1]->farewell(), nullptr);
  EXPECT_EQ(stand.hosts[1]->farewell()->code, Errc::kOverload);
  EXPECT_NE(stand.hosts[1]->farewell()->message.find("idle longest"), std::string::npos);
  EXPECT_EQ(stand.rig->control().clients(), kMaxHosts);
}

TEST(Hosts, ThatPull_AreNotClosedForANewOneHoweverLongTheyAskedNothing) {
  Stand stand;
  TestHost& first = stand.bring_up();
  std::vector<TestHost*> pulling{&first};
  std::vector<StreamId> streams{first.pull(false, 0)};
  while (pulling.size() < firmware::Admission::kMaxWorking) {
    pulling.push_back(&stand.connect());
    streams.push_back(pulling.back()->pull(false, 0));
  }
  TestHost& ninth = stand.connect();
  EXPECT_EQ(ninth.pull(false, 0), 0u);
  EXPECT_EQ(ninth.refusal.code(), static_cast<unsigned>(Errc::kOverload));
  stand.run(Duration::seconds(1));
  for (std::size_t i = 0; i < 3 * kMaxHosts; ++i) {
    EXPECT_EQ(stand.connect().status().state(), "running");
    stand.run(Duration::milliseconds(5));
  }
  for (std::size_t i = 0; i < pulling.size(); ++i) {
    EXPECT_FALSE(pulling[i]->dead());
    EXPECT_EQ(pulling[i]->dropped[streams[i]], 0u);
  }
}

TEST(Hosts, LinksThatSayNoHello_KeepNobodyOut) {
  Stand stand;
  std::vector<std::unique_ptr<hal::sim::SimLink>> silent;
  for (int i = 0; i < 100; ++i) {
    silent.push_back(stand.listener.connect());
    // Half a frame, as from a host that died while writing.
    const std::array<std::uint8_t, 4> half{'N', 'O', 'D', 'L'};
    const auto bytes = std::span(half).first(i % 2 == 0 ? 4 : 0);
    ASSERT_TRUE(silent.back()->write(bytes));
  }
  EXPECT_EQ(stand.connect().status().state(), "no-calibration");
  EXPECT_LE(stand.rig->control().clients(), firmware::Admission::kMaxStrangers + 1);
  stand.run(firmware::HostActivity::kHelloWithin + Duration::milliseconds(200));
  EXPECT_EQ(stand.rig->control().clients(), 1u);
}

TEST(Hosts, AFrameThatIsNotWholeInTime_EndsItsHost) {
  Stand stand;
  TestHost& host = stand.connect();
  stand.run(Duration::milliseconds(20));
  wire::Request request;
  request.mutable_status();
  host.post(request);
  const auto frame = host.session().output();
  ASSERT_TRUE(host.link().write(frame.first(frame.size() - 1)));
  host.reading = false;
  TestHost* const half = &host;
  const std::unique_ptr<TestHost> apart = std::move(stand.hosts.front());  // it writes nothing more
  stand.hosts.clear();
  stand.run(firmware::HostActivity::kFrameWithin * 3 / 4);
  EXPECT_EQ(stand.rig->control().clients(), 1u);
  stand.run(firmware::HostActivity::kFrameWithin / 2);
  EXPECT_EQ(stand.rig->control().clients(), 0u);
  half->reading = true;
  half->pump();
  ASSERT_NE(half->farewell(), nullptr);
  EXPECT_EQ(half->farewell()->code, Errc::kTimeout);
}

TEST(Hosts, OneThatAsksNothingForAnHour_StaysSinceItAnswersPings) {
  Stand stand;
  TestHost& quiet = stand.connect();
  stand.run(Duration::milliseconds(20));
  for (int i = 0; i < 360; ++i) {
    stand.world.clock().advance(Duration::seconds(10));
    stand.settle();
  }
  EXPECT_FALSE(quiet.dead());
  EXPECT_EQ(quiet.status().state(), "no-calibration");
}

TEST(Hosts, OneThatAnswersNoPing_IsClosed) {
  Stand stand;
  stand.connect();
  stand.run(Duration::milliseconds(20));
  const std::unique_ptr<TestHost> frozen = std::move(stand.hosts.front());
  stand.hosts.clear();
  for (int i = 0; i < 31; ++i) {
    stand.world.clock().advance(Duration::seconds(10));
    stand.settle();
  }
  EXPECT_EQ(stand.rig->control().clients(), 0u);
}

TEST(Hosts, OneFloodsTheRigWithRequests_AnotherIsAnsweredAtOnce) {
  Stand stand;
  TestHost& greedy = stand.connect();
  TestHost& good = stand.connect();
  stand.run(Duration::milliseconds(20));
  wire::Request request;
  request.mutable_status();
  std::vector<std::uint64_t> ids;
  for (int i = 0; i < 2000; ++i) ids.push_back(greedy.post(request));
  const std::uint64_t id = good.post(request);
  // One step of all hosts at a time: the greedy host is served a few requests at a time, the good one in between.
  int steps = 0;
  for (; steps < 100 && !good.reply(id); ++steps) {
    stand.rig->step_control();
    greedy.pump();
    good.pump();
  }
  EXPECT_LT(steps, 10);
  EXPECT_EQ(greedy.reply(ids.back()), nullptr);
  stand.settle();
  EXPECT_NE(greedy.reply(ids.back()), nullptr) << "it is answered, too";
}

TEST(Hosts, AreListedWithWhatTheyDo) {
  Stand stand;
  TestHost& host = stand.bring_up();
  TestHost& watcher = stand.connect();
  watcher.pull(true, 0);
  watcher.pull(false, 0, true);
  stand.run(Duration::seconds(2));
  const wire::Hosts hosts = list_hosts(host);
  ASSERT_EQ(hosts.hosts_size(), 2);
  EXPECT_TRUE(hosts.hosts(0).asking());
  const wire::HostState& other = hosts.hosts(1);
  EXPECT_EQ(other.number(), 2u);
  EXPECT_EQ(other.software(), "a test");
  EXPECT_NE(other.peer(), "");
  ASSERT_EQ(other.streams_size(), 2);
  EXPECT_EQ(other.streams(0), "pulls jpeg");
  EXPECT_EQ(other.streams(1), "pulls raw lossless");
  EXPECT_GE(other.connected_ns(), 2'000'000'000u);
  EXPECT_LT(other.idle_ns(), 100'000'000u) << "its raymaps go out";
  EXPECT_GT(other.bytes_out(), 60u * 128 * 64 * 3);
  EXPECT_GT(other.bytes_in(), 0u);
}

TEST(Hosts, OneIsEndedByAnother_ItIsToldByWhom) {
  Stand stand;
  TestHost& host = stand.bring_up();
  TestHost& other = stand.connect();
  other.pull(false, 0);
  wire::Request end;
  end.mutable_host_end()->set_number(2);
  EXPECT_TRUE(host.ask(end).has_done());
  stand.run(Duration::milliseconds(50));
  ASSERT_NE(other.farewell(), nullptr);
  EXPECT_EQ(other.farewell()->code, Errc::kCancelled);
  EXPECT_NE(other.farewell()->message.find("host 1"), std::string::npos);
  EXPECT_EQ(host.ask(end).error().code(), static_cast<unsigned>(Errc::kNotFound));
  end.mutable_host_end()->set_number(1);
  EXPECT_EQ(host.ask(end).error().code(), static_cast<unsigned>(Errc::kBadValue)) << "not itself";
}

TEST(Upload, AnotherHostBeginsUploadsInALoop_ItPushesOutOnlyItsOwn) {
  Stand stand;
  TestHost& good = stand.bring_up();
  TestHost& greedy = stand.connect();
  const std::string document = to_json(small_calibration("second")) + std::string(200'000, ' ');
  const auto begin_some = [&](int from) {
    for (int i = from; i < from + 100; ++i) {
      wire::Request begin;
      begin.mutable_upload_begin()->set_length(1000);
      const std::string name = std::to_string(i);
      begin.mutable_upload_begin()->set_sha256(
          sha256_to_wire(sha256({reinterpret_cast<const std::uint8_t*>(name.data()), name.size()})));
      EXPECT_TRUE(greedy.ask(begin).has_upload());
    }
  };
  begin_some(0);
  good.send_document(document);
  begin_some(100);
  stand.run(Duration::seconds(1));
  begin_some(200);
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request commit;
  *commit.mutable_upload_commit() = UploadSender(bytes).commit();
  const wire::Reply done = good.ask(commit);
  ASSERT_TRUE(done.has_done()) << done.error().message();
}

}  // namespace
}  // namespace nodal::scenario
