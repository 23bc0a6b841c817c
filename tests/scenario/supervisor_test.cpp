// The rig under its supervisor: an end with one reason, and a board that is too slow.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

TEST(SupervisorScenario, TheRigIsEnded_HostsHearTheReasonAndNobodyIsLetInAnyMore) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId pull = host.pull(true, 0);
  stand.run(Duration::milliseconds(300));
  EXPECT_TRUE(stand.watchdog.is_ready());
  EXPECT_TRUE(stand.tally_lamp.level_at(stand.world.clock().now()));

  stand.rig->control().ask_to_end("SIGTERM");
  stand.run(Duration::milliseconds(100));
  EXPECT_TRUE(stand.rig->control().ended());
  EXPECT_EQ(stand.state(), "stopping");
  EXPECT_TRUE(stand.watchdog.is_stopping());
  ASSERT_NE(host.farewell(), nullptr);
  EXPECT_NE(host.farewell()->message.find("the rig stops: SIGTERM"), std::string::npos) << host.farewell()->message;
  EXPECT_GT(host.pulled[pull].size(), 3U) << "what was given before stays given";
  EXPECT_FALSE(stand.status_lamp.level_at(stand.world.clock().now()));
  EXPECT_FALSE(stand.tally_lamp.level_at(stand.world.clock().now()));

  stand.connect();
  stand.run(Duration::milliseconds(100));
  EXPECT_EQ(stand.rig->control().clients(), 0U);
}

TEST(SupervisorScenario, AHostThatDoesNotRead_HoldsTheEndUpForNoLongerThanAFarewell) {
  Stand stand;
  TestHost& host = stand.bring_up();
  host.pull(false, 0);
  host.reading = false;
  stand.run(Duration::seconds(3));
  stand.rig->control().ask_to_end("SIGTERM");
  stand.run(firmware::Control::kFarewell + Duration::milliseconds(100));
  EXPECT_TRUE(stand.rig->control().ended());
}

/// A board with a slow blend; capture and control have their own threads.
void run_slow(Stand& stand, Duration duration, int blend_every_ms) {
  firmware::Rig& rig = *stand.rig;
  for (std::int64_t ms = 0; ms < duration.ms(); ++ms) {
    stand.world.clock().advance(Duration::milliseconds(1));
    rig.step_capture();
    rig.step_keeper();
    if (ms % blend_every_ms == 0) {
      // One set: its bands, and the work between them.
      const std::uint64_t before = rig.blender().counts().blended.load() + rig.blender().counts().shed.load();
      while (rig.blender().counts().blended.load() + rig.blender().counts().shed.load() == before && rig.step_blend()) {
      }
      while (rig.step_encode()) {}
    }
    rig.step_control();
    for (const auto& host : stand.hosts) host->pump();
  }
}

TEST(SupervisorScenario, ABoardThatIsTooSlow_ShedsForHostsAndCaptureLosesNothing) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId live = host.pull(true, 0);
  stand.run(Duration::seconds(1));
  const std::uint64_t lost = stand.capture().frames.lost();
  const std::uint64_t sets = stand.capture().sets;
  const std::size_t pulled = host.pulled[live].size();
  run_slow(stand, Duration::seconds(20), 60);  // half of the arriving sets

  EXPECT_EQ(stand.state(), "degraded");
  EXPECT_NE(stand.rig->control().health().problem.find("1 of 8 raymaps"), std::string::npos)
      << stand.rig->control().health().problem;
  EXPECT_NEAR(static_cast<double>(stand.capture().sets - sets), 20 * 29.97, 3);
  EXPECT_EQ(stand.capture().frames.lost(), lost) << "capture never waits";
  const std::size_t given = host.pulled[live].size() - pulled;
  EXPECT_GT(given, 20U);
  EXPECT_LT(given, 200U) << "of 333 that were blended";
  const wire::RigStatus status = stand.rig->control().status(stand.world.clock().now());
  EXPECT_GT(status.publish_shed(), 100U);

  stand.run(Duration::seconds(90));
  EXPECT_EQ(stand.state(), "running") << stand.rig->control().health().problem;
  const std::size_t before = host.pulled[live].size();
  stand.run(Duration::seconds(1));
  EXPECT_GE(host.pulled[live].size() - before, 29U) << "everybody gets everything again";
}

TEST(SupervisorScenario, ABoardThatIsTooSlow_ALosslessPullMissesNoRaymap) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const std::uint64_t from = stand.rig->blender().counts().blended.load();
  const StreamId all = host.pull(true, 0, true);
  run_slow(stand, Duration::seconds(10), 60);
  const std::uint64_t made = stand.rig->blender().counts().blended.load() - from;
  EXPECT_GT(made, 20U);
  EXPECT_GE(host.pulled[all].size() + 4, made) << "four may be under way";
}

}  // namespace
}  // namespace nodal::scenario
