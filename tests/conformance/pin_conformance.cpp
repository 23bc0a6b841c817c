// The tests that every OutputPinPort and InputPinPort must pass.
#include "pin_conformance.h"

#include <thread>
#include <vector>

namespace nodal::hal {

namespace {

constexpr Duration kLease = Duration::milliseconds(50);

TEST_P(PinConformance, OutputNeverSet_IsAtItsSafeLevel) { EXPECT_EQ(world_->output_wire(), world_->safe_level()); }

TEST_P(PinConformance, OutputSet_HoldsForItsLeaseThenIsSafe) {
  const bool unsafe = !world_->safe_level();
  ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
  for (int ms = 0; ms < 40; ms += 5) {
    EXPECT_EQ(world_->output_wire(), unsafe) << ms;
    world_->pass(Duration::milliseconds(5));
    ASSERT_TRUE(world_->output().step(world_->now()));
  }
  world_->pass(kLease);
  ASSERT_TRUE(world_->output().step(world_->now()));
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputSetAgainInTime_TheLeaseBeginsAnew) {
  const bool unsafe = !world_->safe_level();
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
    world_->pass(kLease / 2);
    ASSERT_TRUE(world_->output().step(world_->now()));
    EXPECT_EQ(world_->output_wire(), unsafe);
  }
}

TEST_P(PinConformance, OutputMadeSafeByAnotherThread_StaysSafeWhateverIsAsked) {
  const bool unsafe = !world_->safe_level();
  ASSERT_TRUE(world_->output().set(unsafe, world_->now(), kLease));
  std::thread another([&] { world_->output().make_safe(); });
  for (int i = 0; i < 1000; ++i) {
    if (const Status set = world_->output().set(unsafe, world_->now(), kLease); !set) {
      EXPECT_EQ(set.error().code, Errc::kDeviceGone);
    }
  }
  another.join();
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
  EXPECT_EQ(world_->output().set(unsafe, world_->now(), kLease).error().code, Errc::kDeviceGone);
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputSetBack_IsSafeAtOnce) {
  ASSERT_TRUE(world_->output().set(!world_->safe_level(), world_->now(), kLease));
  ASSERT_TRUE(world_->output().set(world_->safe_level(), world_->now(), kLease));
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, OutputLeaseOfNothing_IsABadValueAndChangesNothing) {
  const Status status = world_->output().set(!world_->safe_level(), world_->now(), Duration{});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, Errc::kBadValue);
  EXPECT_EQ(world_->output_wire(), world_->safe_level());
}

TEST_P(PinConformance, InputDriven_EveryEdgeComesOnceInOrderOfTime) {
  std::vector<PinEdge> seen;
  for (int i = 0; i < 20; ++i) {
    world_->drive_input(i % 2 == 0);
    world_->pass(Duration::milliseconds(10));
    if (i % 3 != 0) continue;  // edges are queued until they are taken
    while (auto edge = world_->input().take_edge().value()) seen.push_back(*edge);
  }
  while (auto edge = world_->input().take_edge().value()) seen.push_back(*edge);
  ASSERT_EQ(seen.size(), 20U);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].high, i % 2 == 0);
    EXPECT_GT(seen[i].at, i > 0 ? seen[i - 1].at : Instant{});
    EXPECT_LE(seen[i].at, world_->now());
  }
}

TEST_P(PinConformance, InputAsked_SaysItsLevelNow) {
  EXPECT_FALSE(world_->input().level().value());
  world_->drive_input(true);
  world_->pass(Duration::milliseconds(10));
  EXPECT_TRUE(world_->input().level().value());
  world_->drive_input(false);
  world_->pass(Duration::milliseconds(10));
  EXPECT_FALSE(world_->input().level().value());
}

}  // namespace
}  // namespace nodal::hal
