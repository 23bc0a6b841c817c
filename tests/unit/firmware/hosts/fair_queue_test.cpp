// Whose turn it is: against a count of the turns that each waiting host sees go by.
#include "firmware/hosts/fair_queue.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

namespace nodal::firmware {
namespace {

using Host = FairQueue::Host;

std::vector<std::uint64_t> all_turns(FairQueue& queue) {
  std::vector<std::uint64_t> turns;
  while (const auto host = queue.next()) turns.push_back(*host);
  return turns;
}

TEST(FairQueue, HostsOfOneUser_AreServedAsTheyCame) {
  FairQueue queue;
  for (const std::uint64_t host : {5, 3, 9}) queue.add({host, Access::kControl, hal::PeerIdentity{1000, 1}});
  EXPECT_EQ(all_turns(queue), (std::vector<std::uint64_t>{5, 3, 9}));
  EXPECT_TRUE(queue.empty());
}

TEST(FairQueue, AHostAtTheControlSocket_GoesBeforeThoseThatOnlyView) {
  FairQueue queue;
  queue.add({1, Access::kView, hal::PeerIdentity{1000, 1}});
  queue.add({2, Access::kView, hal::PeerIdentity{1001, 1}});
  queue.add({3, Access::kControl, hal::PeerIdentity{1002, 1}});
  EXPECT_EQ(queue.highest(), Access::kControl);
  EXPECT_EQ(all_turns(queue), (std::vector<std::uint64_t>{3, 1, 2}));
  EXPECT_EQ(queue.highest(), std::nullopt);
}

TEST(FairQueue, AUserWithManyHosts_GetsEverySecondTurnBesideAUserWithOne) {
  FairQueue queue;
  for (std::uint64_t host = 1; host <= 5; ++host) queue.add({host, Access::kControl, hal::PeerIdentity{1000, 1}});
  for (std::uint64_t turn = 0; turn < 10; ++turn) {
    const std::uint64_t honest = 100 + turn;
    queue.add({honest, Access::kControl, hal::PeerIdentity{1001, 1}});
    const auto first = queue.next();
    const auto second = queue.next();
    EXPECT_TRUE(first == honest || second == honest) << "turn " << turn;
    queue.add({first == honest ? *second : *first, Access::kControl, hal::PeerIdentity{1000, 1}});
  }
}

TEST(FairQueue, AProcessWithManyHosts_GetsEverySecondTurnBesideAnotherProcessOfItsUser) {
  FairQueue queue;
  for (std::uint64_t host = 1; host <= 8; ++host) queue.add({host, Access::kControl, hal::PeerIdentity{1000, 7}});
  EXPECT_EQ(queue.next(), 1u);
  queue.add({20, Access::kControl, hal::PeerIdentity{1000, 8}});
  EXPECT_EQ(queue.next(), 20u);
  EXPECT_EQ(queue.next(), 2u);
}

TEST(FairQueue, AHostThatOnlyViews_IsServedAlthoughControlHostsAskWithoutAPause) {
  FairQueue queue;
  queue.add({1, Access::kView, hal::PeerIdentity{1000, 1}});
  queue.add({2, Access::kControl, hal::PeerIdentity{1000, 1}});
  std::size_t before = 0;
  for (auto host = queue.next(); host != 1; host = queue.next()) {
    ASSERT_TRUE(host);
    ++before;
    ASSERT_LE(before, FairQueue::kMaxPassed);
    queue.add({*host, Access::kControl, hal::PeerIdentity{1000, 1}});
  }
  EXPECT_EQ(before, FairQueue::kMaxPassed) << "control goes before view until then";
}

TEST(FairQueue, AHostThatLeaves_GetsNoTurn) {
  FairQueue queue;
  queue.add({1, Access::kControl, hal::PeerIdentity{1000, 1}});
  queue.add({2, Access::kControl, hal::PeerIdentity{1000, 1}});
  queue.leave(1);
  EXPECT_FALSE(queue.waits(1));
  EXPECT_EQ(all_turns(queue), std::vector<std::uint64_t>{2});
}

/// Any hosts of any users arrive, leave and are served, as hostile as may be.
RC_GTEST_PROP(FairQueue, WhateverOthersDo_NobodyWaitsForMoreTurnsThanHostsWereThereAndTheLimit, ()) {
  FairQueue queue;
  std::map<std::uint64_t, std::size_t> may_wait;  // turns of others, by host that waits
  std::uint64_t next_host = 1;
  const auto steps = *rc::gen::container<std::vector<int>>(300, rc::gen::inRange(0, 10));
  for (const int step : steps) {
    if (step < 5 && may_wait.size() < 40) {
      const auto access = step < 3 ? Access::kControl : Access::kView;
      const auto user = *rc::gen::inRange<std::uint32_t>(0, 30);
      may_wait[next_host] = may_wait.size() + FairQueue::kMaxPassed;
      const auto process = *rc::gen::inRange<std::int32_t>(0, 5);
      queue.add({next_host++, access, user == 0 ? std::nullopt : std::optional(hal::PeerIdentity{user, process})});
    } else if (step < 9) {
      const auto served = queue.next();
      RC_ASSERT(served.has_value() == !may_wait.empty());
      if (!served) continue;
      RC_ASSERT(may_wait.erase(*served) == 1);
      for (auto& [host, turns] : may_wait) {
        RC_ASSERT(turns > 0);
        --turns;
      }
    } else if (!may_wait.empty()) {
      const auto gone =
          std::next(may_wait.begin(), *rc::gen::inRange<int>(0, static_cast<int>(may_wait.size())))->first;
      queue.leave(gone);
      may_wait.erase(gone);
    }
    RC_ASSERT(queue.size() == may_wait.size());
  }
}

}  // namespace
}  // namespace nodal::firmware
