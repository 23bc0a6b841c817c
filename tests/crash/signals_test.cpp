// Every signal from 1 to SIGRTMAX, sent to the real nodald and the real nodal: the outcome is what the manual pages
// say.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "hal/linux/link/signals.h"
#include "nodald_process.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

using hal::SignalOutcome;

/// The paragraphs of a manual page's section SIGNALS: for each heading, the signals that its text names.
std::map<std::string, std::set<std::string>> manual_table(const std::string& page) {
  std::ifstream file(NODAL_SOURCE_DIR + ("/" + page));
  std::map<std::string, std::set<std::string>> table;
  bool inside = false;
  std::string heading;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(".SH ")) inside = line == ".SH SIGNALS";
    if (!inside) continue;
    for (const char* known : {".B End ", ".B Ignored", ".B Crash", ".B Not handled"}) {
      if (line.starts_with(known)) heading = known;
    }
    if (heading.empty()) continue;
    for (std::size_t at = line.find("SIG"); at != std::string::npos; at = line.find("SIG", at + 3)) {
      table[heading].insert(line.substr(at, line.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", at) - at));
    }
  }
  return table;
}

std::string heading_of(SignalOutcome outcome) {
  switch (outcome) {
    case SignalOutcome::kEnds: return ".B End ";
    case SignalOutcome::kIgnored: return ".B Ignored";
    case SignalOutcome::kCrashes: return ".B Crash";
    case SignalOutcome::kKernels: return ".B Not handled";
  }
  return "";
}

std::set<int> all_of(SignalOutcome outcome) {
  std::set<int> all;
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    const bool of_libc = signal > SIGSYS && signal < SIGRTMIN;  // used by its threads
    if (!of_libc && hal::outcome_of(signal) == outcome) all.insert(signal);
  }
  return all;
}

TEST(Signals, BothManualPages_ListEachUnderWhatIsDoneWithIt) {
  for (const char* page : {"firmware/daemon/nodald.8", "host_tool/nodal.1"}) {
    auto table = manual_table(page);
    for (const SignalOutcome outcome :
         {SignalOutcome::kEnds, SignalOutcome::kIgnored, SignalOutcome::kCrashes, SignalOutcome::kKernels}) {
      std::set<std::string>& listed = table[heading_of(outcome)];
      for (const int signal : all_of(outcome)) {
        const std::string name = signal >= SIGRTMIN ? "SIGRTMIN" : hal::signal_name(signal);
        EXPECT_TRUE(listed.contains(name)) << page << " does not list " << name << " under " << heading_of(outcome);
      }
    }
    for (const std::string& listed : table[".B Ignored"]) {
      EXPECT_FALSE(table[".B End "].contains(listed) || table[".B Crash"].contains(listed)) << page << ": " << listed;
    }
  }
}

/// nodald that records a take on a rig of its own.
class FilmingRig {
 public:
  FilmingRig() {
    std::ofstream(folder_.path / "rig.toml", std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
    daemon_.emplace(nodald({"--config", folder_.config()}));
    host_ = LinkHost::connect(folder_.socket());
  }
  /// False if no take is recorded within a minute.
  bool record() {
    if (!host_) return false;
    std::ifstream truth(folder_.path / "truth.json");
    const std::string document{std::istreambuf_iterator<char>(truth), {}};
    if (!host_->upload_and_commit(document)) return false;
    if (!host_->wait_for([](const wire::RigStatus& status) { return status.full_sets() > 3; })) return false;
    wire::Request start;
    start.mutable_take_start();
    const auto reply = host_->ask(start);
    return reply && reply->has_take() &&
           host_->wait_for([](const wire::RigStatus& status) { return status.recording().sets() > 0; });
  }
  test::Process& daemon() { return *daemon_; }
  LinkHost& host() { return *host_; }
  bool take_ended() const { return std::filesystem::exists(folder_.path / "takes/000001/manifest"); }
  bool socket_exists() const { return std::filesystem::exists(folder_.socket()); }

 private:
  RigFolder folder_;
  std::optional<test::Process> daemon_;
  std::unique_ptr<LinkHost> host_;
};

TEST(Signals, ThatEndNodald_TheTakeHasItsManifestAndTheSocketIsRemoved) {
  for (const int signal : all_of(SignalOutcome::kEnds)) {
    SCOPED_TRACE(hal::signal_name(signal));
    FilmingRig rig;
    ASSERT_TRUE(rig.record()) << rig.daemon().complained();
    rig.daemon().signal(signal);
    const test::Finished ended = rig.daemon().wait(std::chrono::seconds(60));
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_NE(ended.err.find(hal::signal_name(signal) + ": stopping"), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find("stopped: "), std::string::npos) << ended.err;
    EXPECT_TRUE(rig.take_ended());
    EXPECT_FALSE(rig.socket_exists());
  }
}

TEST(Signals, ThatNodaldIgnores_ItAnswersAndRecordsOn) {
  FilmingRig rig;
  ASSERT_TRUE(rig.record()) << rig.daemon().complained();
  for (const int signal : all_of(SignalOutcome::kIgnored)) rig.daemon().signal(signal);
  const auto before = rig.host().status();
  ASSERT_TRUE(before) << rig.daemon().complained();
  EXPECT_TRUE(rig.host().wait_for([&](const wire::RigStatus& status) {
    return status.recording().sets() > before->recording().sets() + 3;
  })) << rig.daemon().complained();
}

TEST(Signals, ThatAreACrashOfNodald_OutputsAreSafeBeforeItEnds) {
  for (const int signal : all_of(SignalOutcome::kCrashes)) {
    SCOPED_TRACE(hal::signal_name(signal));
    FilmingRig rig;
    ASSERT_TRUE(rig.host().status()) << rig.daemon().complained();
    rig.daemon().signal(signal);
    const test::Finished ended = rig.daemon().wait(std::chrono::seconds(60));
    EXPECT_EQ(ended.code, 128 + signal) << ended.err;
    EXPECT_NE(ended.err.find("received " + hal::signal_name(signal) + "; outputs are at their safe levels"),
              std::string::npos)
        << ended.err;
  }
}

/// `nodal` that waits for the rig until it is told to end.
test::Process watching(const std::string& socket) {
  return test::Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + socket, "status", "--watch", "--count", "100000"});
}

TEST(Signals, ThatEndNodal_TheExitCodeIs128AndTheSignal) {
  const RigFolder folder;
  test::Process daemon(nodald({"--config", folder.config()}));
  ASSERT_TRUE(LinkHost::connect(folder.socket())) << daemon.complained();
  for (const SignalOutcome outcome : {SignalOutcome::kEnds, SignalOutcome::kCrashes}) {
    for (const int signal : all_of(outcome)) {
      SCOPED_TRACE(hal::signal_name(signal));
      test::Process nodal = watching(folder.socket());
      ASSERT_TRUE(test::wait_until([&] { return !nodal.said().empty(); })) << nodal.complained();
      for (const int stray : all_of(SignalOutcome::kIgnored)) nodal.signal(stray);
      const std::size_t lines = nodal.said().size();
      ASSERT_TRUE(test::wait_until([&] { return nodal.said().size() > lines; })) << "a stray signal ended it";
      nodal.signal(signal);
      const test::Finished ended = nodal.wait(std::chrono::seconds(60));
      EXPECT_EQ(ended.code, 128 + signal) << ended.err;
    }
  }
}

TEST(Signals, AfterNohup_AHangUpEndsNothing) {
  // The shell ignores SIGHUP for the program that replaces it.
  const RigFolder folder;
  std::string command = "trap '' HUP; exec";
  for (const std::string& word : nodald({"--config", folder.config()})) command += " '" + word + "'";
  test::Process daemon({"/bin/sh", "-c", command});
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  daemon.signal(SIGHUP);
  EXPECT_TRUE(host->status()) << daemon.complained();
  EXPECT_TRUE(host->status()) << daemon.complained();
}

}  // namespace
}  // namespace nodal::crash
