// A user with a button and two lamps, without a host.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

void press(Stand& stand, Duration length) {
  const Instant now = stand.world.clock().now();
  stand.button.script(now, true);
  stand.button.script(now + length, false);
  stand.run(length + Duration::milliseconds(100));
}

TEST(PanelScenario, PressPressHold_StartsMarksAndStopsARigWithoutAHost) {
  Stand stand;
  TestHost& host = stand.bring_up();
  press(stand, Duration::milliseconds(150));
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == firmware::GenlockState::kLocked; }));
  EXPECT_TRUE(stand.tally_lamp.level_at(stand.world.clock().now()));
  EXPECT_TRUE(stand.status_lamp.level_at(stand.world.clock().now()));

  const std::uint64_t before = stand.capture().sets;
  press(stand, Duration::milliseconds(150));
  const wire::RigStatus status = host.status();
  ASSERT_EQ(status.marks_size(), 1);
  EXPECT_GE(status.marks(0).set(), before - 1);
  EXPECT_LT(status.marks(0).set(), stand.capture().sets);

  press(stand, Duration::seconds(2));
  EXPECT_EQ(stand.capture().genlock.state, firmware::GenlockState::kOff);
  EXPECT_FALSE(stand.tally_lamp.level_at(stand.world.clock().now()));
}

TEST(PanelScenario, MoreMarksThanAreKept_TheOldestGo) {
  Stand stand;
  TestHost& host = stand.bring_up();
  press(stand, Duration::milliseconds(150));
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == firmware::GenlockState::kLocked; }));
  const std::uint64_t before = stand.capture().sets;
  for (int i = 0; i < 35; ++i) press(stand, Duration::milliseconds(150));
  const wire::RigStatus status = host.status();
  ASSERT_EQ(status.marks_size(), 32);  // Operation::kMarksKept
  EXPECT_GE(status.marks(0).set(), before + 3 * 4) << "three are gone, each some seven sets after the one before";
}

TEST(PanelScenario, StartedByTheButton_ItRollsAgainAfterAPowerLoss) {
  std::unique_ptr<hal::sim::SimDisk> kept;
  {
    Stand stand;
    stand.bring_up();
    press(stand, Duration::milliseconds(150));
    stand.run(Duration::seconds(2));
    kept = stand.disk->after_power_loss(5);
  }
  Stand again({}, std::move(kept));
  EXPECT_TRUE(again.run_until([&] { return again.capture().genlock.state == firmware::GenlockState::kLocked; }));
}

}  // namespace
}  // namespace nodal::scenario
