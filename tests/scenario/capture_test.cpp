// Heads that come and go, frames that are bad, and a capture thread that is kept waiting.
#include <gtest/gtest.h>

#include "stand.h"

namespace nodal::scenario {
namespace {

using firmware::GenlockState;
using firmware::LossReason;

wire::Request genlock(wire::GenlockRequest::Action action) {
  wire::Request request;
  request.mutable_genlock()->set_action(action);
  return request;
}

/// A rig with its calibration in force and its heads locked.
TestHost& bring_up_locked(Stand& stand) {
  TestHost& host = stand.bring_up();
  EXPECT_TRUE(host.ask(genlock(wire::GenlockRequest::START)).has_genlock());
  EXPECT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }));
  stand.run(Duration::milliseconds(200));
  return host;
}

TEST(Capture, WhenTheThreadStalls_NothingIsLostThatTheHeadsHadBuffersFor) {
  for (const bool locked : {false, true}) {
    Stand stand;
    locked ? bring_up_locked(stand) : stand.bring_up();
    const std::uint64_t lost = stand.capture().frames.lost();
    const std::uint64_t sets = stand.capture().sets;
    for (int stall = 0; stall < 20; ++stall) {
      stand.world.clock().advance(Duration::milliseconds(150 + 5 * stall));  // up to 7 of the 8 buffers
      stand.settle();
      stand.run(Duration::milliseconds(50));
    }
    EXPECT_EQ(stand.capture().frames.lost(), lost) << (locked ? "locked" : "in free run");
    EXPECT_GT(stand.capture().sets, sets + 140);
  }
}

}  // namespace
}  // namespace nodal::scenario
