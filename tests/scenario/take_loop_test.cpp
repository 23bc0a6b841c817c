// A whole rig that records in a loop: six heads, genlock, blend, hosts, for as many virtual minutes as
// NODAL_LOOP_MINUTES says. The stand checks after every millisecond that all frames are accounted for. 1440 minutes, a
// day, take some minutes.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cstdlib>

#include "firmware/record/recording.h"
#include "firmware/record/take_keeper.h"
#include "tests/scenario/stand.h"
#include "tests/support/take_account.h"
#include "tests/support/take_stage.h"

namespace nodal::scenario {
namespace {

using firmware::TakeKeeper;

constexpr std::uint64_t kSetsASecond = 5;
constexpr int kWarmUp = 6;  // minutes, until the disk is full

int minutes() {
  const char* const wanted = std::getenv("NODAL_LOOP_MINUTES");
  return std::max(kWarmUp + 3, wanted ? std::atoi(wanted) : 0);
}

/// Without what the disk holds, which is memory here.
std::size_t heap_bytes(const hal::sim::SimDisk& disk) {
  const struct mallinfo2 now = mallinfo2();
  return now.uordblks + now.hblkhd - disk.memory();
}

TEST(TakeLoop, ARigThatFilmsForLong_LosesNothingKeepsMarksAndNeedsNoMoreDiskOrMemory) {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16, .loop = true};
  options.config.rate = FrameRate{kSetsASecond, 1};
  constexpr std::uint64_t kRoom = 100'000'000;  // four minutes of pictures
  const std::uint64_t capacity = 2 * firmware::Recording::kReserveBytes + (std::uint64_t{16} << 20) + kRoom;
  Stand stand(std::move(options), nullptr, std::make_unique<hal::sim::SimDisk>(1, capacity));
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const auto ask = [&](const std::function<void(wire::Request&)>& fill) {
    wire::Request request;
    fill(request);
    return host.ask(request);
  };
  ASSERT_TRUE(ask([](wire::Request& request) { request.mutable_take_start(); }).has_take());
  std::uint64_t marked = 0, least_free = ~std::uint64_t{0};
  std::size_t heap_early = 0, heap_most = 0;
  for (int minute = 0; minute < minutes(); ++minute) {
    stand.run(Duration::seconds(60));
    const wire::RigStatus status = host.status();
    ASSERT_EQ(status.recording().take(), 1U) << status.problem();
    ASSERT_EQ(status.state(), "running") << status.problem();
    ASSERT_EQ(status.recording().lost_sets(), 0U);
    ASSERT_LT(status.recording().durable_ns(), 1'000'000'000U);
    ASSERT_EQ(status.genlock().state(), "locked");
    least_free = std::min(least_free, stand.takes->free_bytes().value());
    if (minute == 1) {
      marked = status.recording().sets();
      ASSERT_TRUE(ask([](wire::Request& request) { request.mutable_take_mark()->set_text("here"); }).has_take());
    }
    if (minute < kWarmUp) heap_early = std::max(heap_early, heap_bytes(*stand.takes));
    else heap_most = std::max(heap_most, heap_bytes(*stand.takes));
  }
  ASSERT_TRUE(ask([](wire::Request& request) { request.mutable_take_stop(); }).has_take());
  EXPECT_GE(least_free, firmware::Recording::kReserveBytes);
  EXPECT_LT(heap_most, heap_early + (std::size_t{2} << 20));

  const wire::TakeEntry take = ask([](wire::Request& request) { request.mutable_take_list(); }).takes().takes(0);
  EXPECT_EQ(take.state(), "complete");
  const firmware::TakeAccount account = firmware::account_of(*stand.takes, 1);
  EXPECT_EQ(account.sets, take.sets());
  EXPECT_EQ(account.missed + account.cut, 0U);
  EXPECT_EQ(account.end, take.sets() + take.deleted_sets());
  EXPECT_NEAR(static_cast<double>(account.end), static_cast<double>(minutes()) * 60 * kSetsASecond, 20);
  EXPECT_GT(take.deleted_sets(), 60 * kSetsASecond);
  for (const std::uint64_t set : {marked - 40 * kSetsASecond, marked, marked + 50 * kSetsASecond}) {
    EXPECT_TRUE(std::ranges::any_of(account.segments, [&](const auto& s) { return s.first <= set && set < s.second; }))
        << set << " is within a minute of the mark";
  }
}

}  // namespace
}  // namespace nodal::scenario
