// Slots for hosts: counted by socket and by user, so that no user takes another one's.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::Access;
using firmware::Admission;

constexpr hal::PeerIdentity kOther{2000, 815};

wire::Request status_request() {
  wire::Request request;
  request.mutable_status();
  return request;
}

std::size_t alive(const Stand& stand, std::size_t from) {
  return static_cast<std::size_t>(std::count_if(stand.hosts.begin() + static_cast<std::ptrdiff_t>(from),
                                                stand.hosts.end(), [](const auto& host) { return !host->dead(); }));
}

/// `many` hosts connect one after another, send requests, and stay connected.
void storm(Stand& stand, int many, const std::function<TestHost&()>& connect, bool ask = true) {
  for (int i = 0; i < many; ++i) {
    TestHost& one = connect();
    if (ask) one.post(status_request());
    if (i % 3 == 0) stand.run(Duration::milliseconds(1));
  }
  stand.run(Duration::milliseconds(20));
}

TEST(Places, AStormAtTheViewOnlySocket_ClosesNoControlHost) {
  Stand stand;
  for (std::size_t i = 0; i < Admission::kMaxClients; ++i) stand.connect();
  stand.run(Duration::milliseconds(20));
  storm(stand, 60, [&]() -> TestHost& { return stand.connect_to_view(); });
  for (std::size_t i = 0; i < Admission::kMaxClients; ++i) EXPECT_FALSE(stand.hosts[i]->dead()) << i;
  EXPECT_EQ(alive(stand, Admission::kMaxClients), Admission::places(Admission::kMaxClients, Access::kView));
}

TEST(Places, LinksWithoutAHelloAtTheViewOnlySocket_TakeNoPlaceOfTheControlSocket) {
  Stand stand;
  std::vector<std::unique_ptr<hal::sim::SimLink>> silent;
  for (int i = 0; i < 100; ++i) silent.push_back(stand.view_listener.connect());
  std::vector<std::unique_ptr<hal::sim::SimLink>> own;
  for (std::size_t i = 0; i < Admission::kMaxStrangers; ++i) own.push_back(stand.listener.connect());
  stand.run(Duration::milliseconds(50));
  EXPECT_EQ(stand.rig->control().clients(), Admission::places(Admission::kMaxStrangers, Access::kControl) +
                                                Admission::places(Admission::kMaxStrangers, Access::kView));
  EXPECT_EQ(stand.connect().status().state(), "no-calibration");
}

/// The good host sends a request once a second, so it is nearly always the one idle longest.
void good_host_survives(hal::PeerIdentity of_storm, bool storm_asks) {
  Stand stand;
  TestHost& good = stand.connect();
  stand.run(Admission::kSpared);
  for (int second = 0; second < 3; ++second) {
    EXPECT_EQ(good.status().state(), "no-calibration");
    storm(
        stand, 200, [&]() -> TestHost& { return stand.connect(of_storm); }, storm_asks);
    stand.run(Duration::milliseconds(900));
    ASSERT_FALSE(good.dead()) << good.farewell()->text();
  }
  EXPECT_EQ(alive(stand, 1), Admission::kMaxClients - 1);
}

TEST(Places, AStormOfAnotherUser_ClosesThatUsersOwn) { good_host_survives(kOther, true); }
TEST(Places, AStormOfAnotherProcessOfTheSameUser_ClosesThatProcessesOwn) { good_host_survives({1000, 99}, true); }
TEST(Places, AStormOfTheSameProcess_ClosesNoneThatAskedBefore) { good_host_survives({1000, 4711}, true); }
TEST(Places, AStormThatAsksNothing_ClosesNoneThatAsks) { good_host_survives({1000, 4711}, false); }

TEST(Places, ANewHostBesideOnesThatAskAllTheTime_HasTimeToAsk) {
  Stand stand;
  for (std::size_t i = 0; i < Admission::kMaxClients; ++i) stand.connect().post(status_request());
  stand.run(Duration::milliseconds(20));
  TestHost& fresh = stand.connect();
  for (int i = 0; i < 15; ++i) {
    stand.run(Duration::milliseconds(100));
    for (std::size_t k = 0; k < Admission::kMaxClients; ++k) {
      if (!stand.hosts[k]->dead()) stand.hosts[k]->post(status_request());
    }
  }
  ASSERT_FALSE(fresh.dead());
  EXPECT_EQ(fresh.status().state(), "no-calibration");
}

TEST(Places, OneUserPullsInEveryPlace_AnotherUsersPullTakesOneAndNoMoreThanItsShare) {
  Stand stand;
  stand.bring_up();
  std::vector<TestHost*> greedy;
  for (std::size_t i = 0; i < Admission::kMaxWorking; ++i) {
    greedy.push_back(&stand.connect(kOther));
    ASSERT_NE(greedy.back()->pull(false, 0), 0u);
  }
  EXPECT_EQ(stand.connect(kOther).pull(false, 0), 0u) << "all places are taken";
  std::size_t got = 0;
  for (std::size_t i = 0; i < Admission::kMaxWorking; ++i) got += stand.connect().pull(false, 0) != 0 ? 1 : 0;
  EXPECT_EQ(got, Admission::kMaxWorking / 2);
  stand.run(Duration::milliseconds(50));
  EXPECT_EQ(std::count_if(greedy.begin(), greedy.end(), [](const TestHost* host) { return !host->dead(); }),
            static_cast<std::ptrdiff_t>(Admission::kMaxWorking / 2));
}

TEST(Places, ViewersThatPullInEveryPlace_RefuseNoControlHost) {
  Stand stand;
  TestHost& control = stand.bring_up();
  std::size_t viewing = 0;
  for (std::size_t i = 0; i < Admission::places(Admission::kMaxClients, Access::kView); ++i) {
    viewing += stand.connect_to_view().pull(false, 0) != 0 ? 1 : 0;
  }
  EXPECT_EQ(viewing, Admission::places(Admission::kMaxWorking, Access::kView));
  for (std::size_t i = 0; i < Admission::kMaxWorking - 1; ++i) EXPECT_NE(stand.connect().pull(false, 0), 0u);
  EXPECT_NE(control.pull(false, 0), 0u);
}

/// Floods of requests for another stage: the other hosts' requests still find room there.
TEST(Places, SomeFloodTheOtherStages_AnothersUploadAndSettingAreNotRefused) {
  Stand stand;
  TestHost& good = stand.bring_up();
  std::vector<TestHost*> flooding;
  std::vector<std::uint64_t> ids;
  for (std::size_t i = 0; i + 1 < Admission::kMaxClients; ++i) flooding.push_back(&stand.connect());
  wire::Request list;
  list.mutable_calibration_list();
  wire::Request set;
  set.mutable_head_set()->set_exposure_ns(1'000'000);
  for (TestHost* host : flooding) {
    for (int k = 0; k < 300; ++k) ids.push_back(host->post(k % 2 == 0 ? list : set));
  }
  const std::uint64_t setting = good.post(set);
  const wire::Reply done = good.upload(to_json(small_calibration("second")));
  EXPECT_TRUE(done.has_done()) << done.error().message();
  ASSERT_NE(good.reply(setting), nullptr);
  EXPECT_TRUE(good.reply(setting)->has_done()) << good.reply(setting)->error().message();
  stand.run(Duration::seconds(3));
  std::size_t answered = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const wire::Reply* const reply = flooding[i / 300]->reply(ids[i]);
    answered += reply && !reply->has_error() ? 1 : 0;
  }
  EXPECT_EQ(answered, ids.size()) << "theirs wait, and are answered";
}

}  // namespace
}  // namespace nodal::scenario
