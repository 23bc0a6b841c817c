// The flight record of the real nodald, whose threads make the order of things different each time.
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <functional>
#include <string>

#include "nodald_process.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;

struct FlyingRig : RigFolder {
  FlyingRig() {
    std::ofstream(config(), std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\nflight_recorder = true\n";
  }
  std::string take() const { return (path / "takes/000001").string(); }
};

wire::Reply reply_to(LinkHost& host, const std::function<void(wire::Request&)>& fill) {
  return host.ask(fill).value_or(wire::Reply());
}

/// Waits until so many sets of the take are recorded.
bool film(LinkHost& host, std::uint64_t sets) {
  return test::wait_until([&] {
    const auto status = host.status();
    return !status || status->recording().sets() >= sets;
  });
}

/// Records, while a host changes what the rig does.
void record(LinkHost& host) {
  ASSERT_TRUE(test::wait_until([&] {
    const auto status = host.status();
    return !status || status->full_sets() > 3;
  }));
  ASSERT_TRUE(reply_to(host, [](wire::Request& request) { request.mutable_take_start(); }).has_take());
  ASSERT_TRUE(film(host, 20));
  const auto genlock = [&](auto action) {
    return reply_to(host, [&](wire::Request& request) { request.mutable_genlock()->set_action(action); });
  };
  ASSERT_TRUE(genlock(wire::GenlockRequest::START).has_genlock());
  ASSERT_TRUE(film(host, 50));
  ASSERT_TRUE(reply_to(host, [](wire::Request& request) {
                request.mutable_head_set()->set_exposure_ns(3'000'000);
              }).has_done());
  ASSERT_TRUE(film(host, 70));
  ASSERT_TRUE(genlock(wire::GenlockRequest::STOP).has_genlock());
  ASSERT_TRUE(genlock(wire::GenlockRequest::START).has_genlock());
  ASSERT_TRUE(film(host, 120));
}

test::Finished replayed(const char* program, const FlyingRig& rig) {
  return test::Process({std::string(NODAL_BIN_DIR "/") + program, rig.take()}).wait();
}

TEST(FlightOfNodald, Stopped_ReplaysWithoutADifferenceAndWithAPlantedBugNamesTheFirst) {
  const FlyingRig rig;
  test::Process daemon(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << daemon.complained();
  record(*host);
  ASSERT_TRUE(reply_to(*host, [](wire::Request& request) { request.mutable_take_stop(); }).has_take());
  const test::Finished same = replayed("flight", rig);
  EXPECT_EQ(same.code, 0) << same.out << same.err;
  EXPECT_NE(same.out.find("no difference"), std::string::npos) << same.out;
  const test::Finished other = replayed("flight_canary", rig);
  EXPECT_EQ(other.code, 1) << other.out << other.err;
  EXPECT_NE(other.out.find("first difference: event "), std::string::npos) << other.out;
}

TEST(FlightOfNodald, KilledWhileRecording_ReplaysWhatIsOnTheDisk) {
  const FlyingRig rig;
  {
    test::Process daemon(nodald({"--config", rig.config()}));
    const auto host = LinkHost::connect(rig.socket());
    ASSERT_TRUE(host) << daemon.complained();
    record(*host);
    daemon.signal(SIGKILL);
    daemon.wait();
  }
  test::Process again(nodald({"--config", rig.config()}));
  const auto host = LinkHost::connect(rig.socket());
  ASSERT_TRUE(host) << again.complained();
  ASSERT_TRUE(test::wait_until([&] { return fs::exists(rig.take() + "/manifest"); }));
  const test::Finished same = replayed("flight", rig);
  EXPECT_EQ(same.code, 0) << same.out << same.err;
  EXPECT_NE(same.out.find("no difference"), std::string::npos) << same.out;
}

}  // namespace
}  // namespace nodal::crash
