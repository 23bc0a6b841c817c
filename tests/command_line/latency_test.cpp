// nodal heads latency on a running rig, which restores the exposure however the program ends.
#include <csignal>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

class HeadLatency : public RigTest {
 protected:
  std::uint64_t exposure() const { return nodal_json({"heads"}).at(0)["heads"][1]["exposure_ns"].get<std::uint64_t>(); }
};

TEST_F(HeadLatency, OfASimulatedHead_IsTwoFramesAndTheRigStatesIt) {
  start_nodald();
  bring_up();
  const Json measured = nodal_json({"heads", "latency", "cam1"}).at(0);
  EXPECT_EQ(measured["seen_frames"], (Json{{"low", 2}, {"high", 2}})) << measured;  // the simulator's default
  EXPECT_EQ(measured["agrees"], true) << measured;
  const Finished nobody = nodal({"heads", "latency", "cam9"});
  EXPECT_EQ(nobody.code, 5) << nobody.err;
}

TEST_F(HeadLatency, ASignalEndsIt_TheExposureIsRestoredAndItIsNoSuccess) {
  start_nodald();
  bring_up();
  const std::uint64_t before = exposure();
  for (const int signal : {SIGINT, SIGHUP, SIGTERM, SIGKILL}) {
    const auto measuring = start({"heads", "latency", "cam1"});
    ASSERT_TRUE(wait_until([&] { return exposure() != before; }));
    measuring->signal(signal);
    EXPECT_EQ(measuring->wait().code, 128 + signal);
    EXPECT_TRUE(wait_until([&] { return exposure() == before; })) << signal;
  }
}

TEST_F(HeadLatency, ItIsStopped_TheRigRestoresTheExposureAfterAWhile) {
  start_nodald();
  bring_up();
  const std::uint64_t before = exposure();
  const auto measuring = start({"heads", "latency", "cam1"});
  ASSERT_TRUE(wait_until([&] { return exposure() != before; }));
  measuring->signal(SIGSTOP);
  EXPECT_TRUE(wait_until([&] { return exposure() == before; }));
  measuring->signal(SIGKILL);
  measuring->wait();
}

}  // namespace
}  // namespace nodal::command_line
