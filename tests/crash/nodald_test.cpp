// nodald itself: started, asked, killed in the middle of a swap, started again.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>

#include <fcntl.h>
#include <sys/resource.h>
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
  for (int i = 0; i < 2000; ++i) {
    const auto status = host.status();
    if (!status) return false;
    if (status->calibration_id() == id) return true;
    if (!host.pump()) return false;
  }
  return false;
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
  // After the commit so much conversation goes by until the kill: more after an old one was found, less after a new
  // one, so that most kills fall into the swap however fast this machine is.
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

/// A fifo that nobody writes to: whoever opens it to read hangs.
void make_fifo(const std::filesystem::path& file) { ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0); }

/// The process is killed, and the code another, when it does not end by itself.
void expect_end(test::Process& daemon, int code) {
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, code) << daemon.complained();
}

TEST(Nodald, TheCaptureStageHangs_SigtermStillEndsItAndTheOutputsAreSafe) {
  const RigFolder folder;
  make_fifo(folder.path / "pipe.png");
  std::ofstream(folder.path / "rig.toml", std::ios::app) << "[[heads]]\nname = \"pipe\"\nport = \"replay:pipe.png\"\n";
  test::Process daemon(nodald({"--config", folder.config()}));
  ASSERT_TRUE(LinkHost::connect(folder.socket())) << daemon.complained();
  expect_end(daemon, 4);
  EXPECT_NE(daemon.complained().find("nodal-capture hangs; outputs are at their safe levels"), std::string::npos)
      << daemon.complained();
}

TEST(Nodald, ItHangsWhileItStarts_SigtermEndsIt) {
  const RigFolder folder;
  std::filesystem::remove(folder.path / "truth.json");
  make_fifo(folder.path / "truth.json");
  test::Process daemon(nodald({"--config", folder.config()}));
  int writer = -1;  // opens only once nodald has opened the fifo to read
  ASSERT_TRUE(test::wait_until([&] {
    writer = ::open((folder.path / "truth.json").c_str(), O_WRONLY | O_NONBLOCK);
    return writer >= 0;
  }));
  expect_end(daemon, 0);
  ::close(writer);
}

// Whatever the limit, it serves or says in one sentence why it cannot.
TEST(Nodald, TooFewAddressesToStart_EndsWith3AndSaysWhatToChange) {
  int refused = 0;
  for (const int mib : {60, 80, 120, 180, 260, 380}) {
    const RigFolder folder;
    std::vector<std::string> command = nodald({"--config", folder.config(), "--blend-threads", "16"});
    command.insert(command.begin(), {"prlimit", "--as=" + std::to_string(mib * 1024 * 1024)});
    test::Process daemon(command);
    ASSERT_TRUE(test::wait_until([&] {
      const std::string said = daemon.complained();
      return said.find("hosts can connect") != std::string::npos || said.find("cannot start") != std::string::npos;
    })) << daemon.complained();
    daemon.signal(SIGTERM);
    const test::Finished finished = daemon.wait(std::chrono::seconds(20));
    EXPECT_TRUE(finished.code == 0 || finished.code == 3) << finished.code << " at " << mib << " MiB\n" << finished.err;
    if (finished.code != 3) continue;
    ++refused;
    EXPECT_NE(finished.err.find("the limit (ulimit -v) is " + std::to_string(mib) + " MiB"), std::string::npos)
        << finished.err;
  }
  EXPECT_GT(refused, 0);
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
