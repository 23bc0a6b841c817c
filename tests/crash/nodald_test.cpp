// nodald itself: started, used, killed during a calibration swap, started again.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "hal/linux/link/socket_link.h"
#include "nodald_process.h"
#include "protocol/upload.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

bool in_force(LinkHost& host, const std::string& id) {
  return host.wait_for([&](const wire::RigStatus& status) { return status.calibration_id() == id; });
}

std::string id_of(const Calibration& calibration) { return sha256_to_wire(calibration_id(calibration)); }

TEST(Nodald, StartedAskedAndStopped_GivesRaymapsAndAccountsForEveryFrame) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  const Calibration calibration = scenario::small_calibration("truth");
  ASSERT_TRUE(host->upload_and_commit(to_json(calibration)));
  ASSERT_TRUE(in_force(*host, id_of(calibration)));
  wire::Request pull;
  pull.mutable_pull()->set_count(5);
  const auto started = host->ask(pull);
  ASSERT_TRUE(started && started->has_pull());
  while (host->raymaps < 5) ASSERT_TRUE(host->pump());
  const auto status = host->status();
  ASSERT_TRUE(status);
  std::uint64_t lost = 0;
  for (const wire::Count& count : status->losses()) lost += count.frames();
  EXPECT_EQ(status->frames_taken(), status->frames_in_sets() + status->frames_held() + lost);
  EXPECT_GT(status->resident_bytes(), 1'000'000u);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 0) << daemon.complained();
  EXPECT_NE(daemon.complained().find("stopped: "), std::string::npos) << daemon.complained();
  EXPECT_FALSE(std::filesystem::exists(folder.socket())) << "its socket goes with it";
}

TEST(Nodald, KilledAtAnyMomentOfASwap_StartsAgainWithTheOldOrTheNewOne) {
  const RigFolder folder;
  std::string now;
  // The number of messages between the commit and the kill: raised after the old calibration was found, lowered after a
  // new one, so that most kills hit the swap on machines of any speed.
  int patience = 0;
  int old_ones = 0;
  int new_ones = 0;
  constexpr int kKills = 20;
  for (int i = 0; i < kKills; ++i) {
    test::Process daemon(nodald({"--config", folder.config()}));
    const auto host = LinkHost::connect(folder.socket());
    ASSERT_TRUE(host) << daemon.complained();
    ASSERT_TRUE(now.empty() || in_force(*host, now)) << "start " << i << "\n" << daemon.complained();
    const Calibration next = scenario::small_calibration("number " + std::to_string(i));
    ASSERT_TRUE(host->upload_and_commit(to_json(next)));
    for (int step = 0; step < patience; ++step) ASSERT_TRUE(host->pump());
    daemon.signal(SIGKILL);
    ASSERT_EQ(daemon.wait(std::chrono::seconds(20)).code, 128 + SIGKILL);

    test::Process again(nodald({"--config", folder.config()}));
    const auto asks = LinkHost::connect(folder.socket());
    ASSERT_TRUE(asks) << again.complained();
    std::optional<wire::RigStatus> status;
    do {
      status = asks->status();
      ASSERT_TRUE(status);
    } while (status->state() == "starting");
    const std::string id = status->calibration_id();
    EXPECT_TRUE(id == now || id == id_of(next)) << "after kill " << i << "\n" << again.complained();
    const bool is_new = id == id_of(next);
    ++(is_new ? new_ones : old_ones);
    patience = is_new ? std::max(0, patience - 7) : patience + 11;
    now = id;
    again.signal(SIGTERM);
    EXPECT_EQ(again.wait(std::chrono::seconds(20)).code, 0);
  }
  EXPECT_GT(old_ones, 0);
  EXPECT_GT(new_ones, 0);
}

/// Kills the process, which changes the code, if it does not end by itself.
void expect_end(test::Process& daemon, int code) {
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, code) << daemon.complained();
}

// Every user who can read the folder can hold such a lock.
TEST(Nodald, SomebodyHoldsALockOnItsSocketsFolder_ItServesAndEndsWhenTold) {
  const RigFolder folder;
  const int held = ::open(folder.path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  ASSERT_EQ(::flock(held, LOCK_EX), 0);
  test::Process daemon(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  EXPECT_TRUE(host->status());
  expect_end(daemon, 0);
  ::close(held);
}

TEST(Nodald, RatesWhoseProductsOverflow_ItAnswersGoesOnAndEndsWhenTold) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  for (const auto& [numerator, denominator] :
       {std::pair{299'700'300U, 10'000'000U}, {2'997'003U, 100'000U}, {4'294'967'295U, 4'294'967'295U}}) {
    wire::Request request;
    request.mutable_genlock()->set_action(wire::GenlockRequest::START);
    request.mutable_genlock()->set_rate_numerator(numerator);
    request.mutable_genlock()->set_rate_denominator(denominator);
    const auto reply = host->ask(request);
    ASSERT_TRUE(reply) << daemon.complained();
    EXPECT_EQ(reply->has_error(), numerator != denominator) << numerator;
  }
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(host->status()) << i;
  const auto asked = std::chrono::steady_clock::now();
  expect_end(daemon, 0);
  EXPECT_LT(std::chrono::steady_clock::now() - asked, std::chrono::seconds(2));
}

TEST(Nodald, AUmaskOfOneUserOnly_HoldsForEveryFileItMakes) {
  const RigFolder folder;
  test::Process daemon({"sh", "-c", "umask 077; exec " NODAL_BIN_DIR "/nodald --config " + folder.config()});
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  const Calibration calibration = scenario::small_calibration("truth");
  ASSERT_TRUE(host->upload_and_commit(to_json(calibration)));
  ASSERT_TRUE(in_force(*host, id_of(calibration)));
  wire::Request exposure;
  exposure.mutable_head_set()->set_exposure_ns(1'000'000);
  ASSERT_TRUE(host->ask(exposure));
  expect_end(daemon, 0);
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path / "store")) {
    struct stat info {};
    ASSERT_EQ(::lstat(entry.path().c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 077, 0u) << entry.path();
    files += S_ISREG(info.st_mode) ? 1 : 0;
  }
  EXPECT_GE(files, 2) << "a calibration and settings";
}

TEST(Nodald, ThroughTheBridge_ItAnswersAsOnItsSocket) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config()}));
  ASSERT_TRUE(LinkHost::connect(folder.socket())) << daemon.complained();
  auto link = hal::spawn_link({std::string(NODAL_BIN_DIR) + "/nodald", "--bridge", "--socket", folder.socket()});
  ASSERT_TRUE(link) << link.error().text();
  LinkHost host(std::move(*link));
  const auto status = host.status();
  ASSERT_TRUE(status);
  EXPECT_EQ(status->rig_name(), "process");
}

TEST(Nodald, WithoutADaemon_TheBridgeSaysSoAndEndsWith3) {
  const RigFolder folder;
  test::Process bridge(nodald({"--bridge", "--socket", folder.socket()}));
  EXPECT_EQ(bridge.wait(std::chrono::seconds(20)).code, 3);
  EXPECT_NE(bridge.complained().find("unreachable"), std::string::npos) << bridge.complained();
}

TEST(Nodald, ABadRigToml_EndsWith2AndSaysWhere) {
  const RigFolder folder;
  std::ofstream(folder.path / "rig.toml", std::ios::app) << "colour = 3\n";
  test::Process daemon(nodald({"--config", folder.config(), "--check"}));
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 2);
  EXPECT_NE(daemon.complained().find("there is no key 'heads[5].colour'"), std::string::npos) << daemon.complained();
}

TEST(Nodald, LogOfCapture_SaysWhatEachHeadDoes) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config(), "--log", "warning,capture=debug"}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  const auto says = [&](const std::string& part) {
    return test::wait_until([&] { return daemon.complained().find(part) != std::string::npos; });
  };
  EXPECT_TRUE(says("debug: capture: sim:cam0: open: ")) << daemon.complained();
  EXPECT_TRUE(says("debug: capture: sim:cam0: start, exposed ")) << daemon.complained();
  EXPECT_EQ(daemon.complained().find(" info: "), std::string::npos) << daemon.complained();
  EXPECT_EQ(daemon.complained().find(": frame "), std::string::npos) << "good frames are at level trace";
}

TEST(Nodald, LogOfACategoryThatThereIsNot_EndsWith2AndNamesThoseThatThereAre) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config(), "--log", "v4l=trace"}));
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 2);
  EXPECT_NE(daemon.complained().find("no category 'v4l'; there are rig, capture, v4l2, iidc, gpio"), std::string::npos)
      << daemon.complained();
}

TEST(Nodald, TruthThatIsMissing_EndsWith2AndNamesTheFile) {
  const RigFolder folder;
  std::filesystem::remove(folder.path / "truth.json");
  test::Process daemon(nodald({"--config", folder.config(), "--check"}));
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 2);
  EXPECT_NE(daemon.complained().find("truth.json"), std::string::npos) << daemon.complained();
}

TEST(Nodald, Check_EndsWith0AndStartsNothing) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config(), "--check"}));
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 0) << daemon.complained();
  EXPECT_FALSE(std::filesystem::exists(folder.path / "store"));
  EXPECT_NE(daemon.said().find("is fine"), std::string::npos);
}

TEST(Nodald, ASecondOneOnTheSameSocket_EndsWith3AndTheFirstGoesOn) {
  const RigFolder folder;
  test::Process first(nodald({"--config", folder.config()}));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << first.complained();
  test::Process second(nodald({"--config", folder.config(), "--store", (folder.path / "other").string()}));
  EXPECT_EQ(second.wait(std::chrono::seconds(30)).code, 3) << second.complained();
  EXPECT_TRUE(host->status());
}

}  // namespace
}  // namespace nodal::crash
