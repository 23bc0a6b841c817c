#include "turns.h"

#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "nodald_process.h"
#include "occupiers.h"
#include "protocol/calibration.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr double kReadWithin = 2, kExclusiveWithin = 10;  ///< seconds
constexpr std::chrono::seconds kEveryAnswerWithin = 110s;

struct HonestCommand {
  std::string name;
  std::vector<std::string> arguments;
  bool exclusive = false;
  int code = 0;  ///< with which it may end as well
};

std::vector<HonestCommand> honest_commands(const RigFolder& folder) {
  return {{"status", {"status"}},
          {"heads", {"heads"}},
          {"genlock show", {"genlock", "show"}},
          {"exposure show", {"exposure", "show"}},
          {"calibration list", {"calibration", "list"}},
          {"calibration show", {"calibration", "show", "-o", (folder.path / "got.json").string()}},
          {"take list", {"take", "list"}},
          {"hosts", {"hosts"}},
          {"audit", {"audit"}},
          {"sync report", {"sync", "report", "-n", "5"}},
          {"raymap pull", {"raymap", "pull", "-o", (folder.path / "pulled.jpg").string()}},
          {"drift", {"drift", "--sets", "1"}, true, 4},  // the small rig's pictures show too little
          {"head set", {"head", "set", "all", "--gain", "0dB"}, true},
          {"calibration upload", {"calibration", "upload", (folder.path / "other.json").string()}, true},
          {"calibration rollback", {"calibration", "rollback"}, true},
          {"offload", {"offload", "1", "--to", (folder.path / "copies").string()}, true},
          {"disk test", {"disk", "test", "--for", "1s"}, true}};
}

/// A calibration of the small rig that takes as long to compile as the budget allows, or nearly.
std::string slow_calibration() {
  Calibration slow = scenario::small_calibration("slow 0 0");
  for (HeadCalibration& head : slow.heads) {
    const double side = head.width;
    for (int m = 0; m < 6; ++m) {  // thin, along the diagonal: the box of each is the whole picture
      std::vector<Region::Point> mask;
      for (int k = 0; k < 8; ++k) mask.push_back({1.0 + m * 0.1 + k * (side - 4) / 7, 1 + k * (side - 4) / 7});
      for (int k = 7; k >= 0; --k) mask.push_back({1.05 + m * 0.1 + k * (side - 4) / 7, 1.02 + k * (side - 4) / 7});
      head.region.masks.push_back(std::move(mask));
    }
  }
  return to_json(slow);
}

class TurnsRig {
 public:
  TurnsRig() {
    std::ofstream(folder.config(), std::ios::app) << "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n";
    std::ifstream in(folder.config());
    std::string text{std::istreambuf_iterator<char>(in), {}};
    const std::string unix_line = "unix = \"sock\"\n";
    text.insert(text.find(unix_line) + unix_line.size(), "view = \"view\"\n");
    // Large enough for a calibration that takes seconds to compile.
    const std::string small = "width = 256\nheight = 128\n";
    text.replace(text.find(small), small.size(), "width = 1024\nheight = 512\n");
    std::ofstream(folder.config()) << text;
  }

  bool start() {
    process_.emplace(std::vector<std::string>{"/bin/sh", "-c", "exec \"$0\" --config \"$1\" 2>\"$2\"",
                                              nodald({}).front(), folder.config(), (folder.path / "log").string()});
    const auto host = LinkHost::connect(folder.socket(), 60);
    if (!host || !host->upload_and_commit(to_json(scenario::small_calibration("second")))) return false;
    if (!host->wait_for([](const wire::RigStatus& now) { return now.raymaps() > 0; })) return false;
    if (!host->upload_and_commit(to_json(scenario::small_calibration("third")))) return false;
    if (!host->wait_for([](const wire::RigStatus& now) { return now.calibration_name() == "third"; })) return false;
    wire::Request begin, end;
    begin.mutable_take_start();
    end.mutable_take_stop();
    const auto begun = host->ask(begin);
    if (!begun || !begun->has_take()) return false;
    if (!host->wait_for([](const wire::RigStatus& now) { return now.recording().sets() > 60; })) return false;
    const auto ended = host->ask(end);
    return ended && ended->has_take();
  }

  /// Until so many hosts have connected.
  void wait_for_hosts(int hosts) {
    const auto host = LinkHost::connect(folder.socket());
    wire::Request request;
    request.mutable_hosts();
    test::wait_until([&] {
      const auto reply = host ? host->ask(request) : std::nullopt;
      return !reply || reply->hosts().hosts_size() > hosts;
    });
  }

  /// Why nodald is not there any more, with the end of its log; empty: it is.
  std::string why_gone() const {
    siginfo_t about{};
    if (::waitid(P_PID, static_cast<id_t>(process_->pid()), &about, WEXITED | WNOHANG | WNOWAIT) != 0)
      return "no child";
    if (about.si_pid == 0) return {};
    std::ifstream in(folder.path / "log");
    const std::string log{std::istreambuf_iterator<char>(in), {}};
    constexpr std::size_t kEnd = 2000;
    return (about.si_code == CLD_EXITED ? "exit code " : "signal ") + std::to_string(about.si_status) + "\n" +
           log.substr(log.size() - std::min(log.size(), kEnd));
  }

  bool stop() {
    process_->signal(SIGTERM);
    return process_->wait(20s).code == 0;
  }

  const RigFolder folder;

 private:
  std::optional<test::Process> process_;
};

struct Waits {
  double read = 0, exclusive = 0;
  std::string slowest_read, slowest_exclusive;
  std::vector<std::string> failed;
};

/// Seconds that each command takes without other hosts: what they take themselves is no wait.
using Alone = std::map<std::string, double>;

Waits run_all(const RigFolder& folder, Alone& alone, bool measures_alone, bool quick) {
  Waits waits;
  for (const HonestCommand& command : honest_commands(folder)) {
    if (quick && command.name == "disk test") continue;  // it lasts a second
    std::filesystem::remove_all(folder.path / "copies");
    std::filesystem::remove(folder.path / "got.json");
    std::filesystem::remove(folder.path / "pulled.jpg");
    std::vector<std::string> words{NODAL_BIN_DIR "/nodal", "--rig", "unix:" + folder.socket(), "--timeout", "60s"};
    words.insert(words.end(), command.arguments.begin(), command.arguments.end());
    const auto begin = Clock::now();
    const test::Finished done = test::Process(words).wait(kEveryAnswerWithin);
    const double took = std::chrono::duration<double>(Clock::now() - begin).count();
    // 8 is a judgement: no mode of recording is sustained.
    if (done.code != 0 && done.code != 8 && done.code != command.code) {
      waits.failed.push_back(command.name + " (" + std::to_string(done.code) + "): " + done.err.substr(0, 200));
    }
    if (measures_alone) alone[command.name] = took;
    const double wait = std::max(0.0, took - alone[command.name]);
    double& longest = command.exclusive ? waits.exclusive : waits.read;
    if (wait < longest) continue;
    longest = wait;
    (command.exclusive ? waits.slowest_exclusive : waits.slowest_read) = command.name;
  }
  return waits;
}

}  // namespace

int run_turns(bool timed, bool quick, const std::string& only) {
  TurnsRig rig;
  if (!rig.start()) {
    std::printf("FAILED: the rig cannot be set up\n");
    return 1;
  }
  std::ofstream(rig.folder.path / "other.json") << to_json(scenario::small_calibration("other"));
  Alone alone;
  int failures = 0;
  for (const std::string& failed : run_all(rig.folder, alone, true, quick).failed) {
    std::printf("FAILED without other hosts: %s\n", failed.c_str());
    ++failures;
  }
  std::printf("%-34s %6s %10s  %-18s %10s  %s\n", "request of the other hosts", "hosts", "reads, s", "longest",
              "exclusive", "longest");
  const Occupiers::Target target{rig.folder.socket(), (rig.folder.path / "view").string(), slow_calibration()};
  for (int k = 0; k < kOccupations; ++k) {
    const auto kind = static_cast<Occupation>(k);
    if (!only.empty() && name_of(kind) != only) continue;
    for (const int hosts : quick ? std::vector<int>{11} : std::vector<int>{1, 4, 16}) {
      Occupiers others(kind, hosts, target);
      // Further ones take each other's places.
      rig.wait_for_hosts(std::min(hosts, kind == Occupation::kFrameSetsViewOnly ? 6 : 11));
      const Waits waits = run_all(rig.folder, alone, false, quick);
      std::printf("%-34s %6d %10.2f  %-18s %10.2f  %s\n", std::string(name_of(kind)).c_str(), hosts, waits.read,
                  waits.slowest_read.c_str(), waits.exclusive, waits.slowest_exclusive.c_str());
      for (const std::string& failed : waits.failed) std::printf("FAILED: %s\n", failed.c_str());
      failures += static_cast<int>(waits.failed.size());
      if (timed && (waits.read > kReadWithin || waits.exclusive > kExclusiveWithin)) {
        std::printf("FAILED: reads may wait for %.0f s, exclusive requests for %.0f s\n", kReadWithin,
                    kExclusiveWithin);
        ++failures;
      }
      if (const std::string why = rig.why_gone(); !why.empty()) {
        std::printf("FAILED: nodald is gone: %s\n", why.c_str());
        return failures + 1;
      }
      if (!others.running()) {
        std::printf("FAILED: the other hosts died\n");
        ++failures;
      }
      std::fflush(stdout);
    }
  }
  if (!rig.stop()) {
    std::printf("FAILED: nodald did not end\n");
    ++failures;
  }
  if (failures == 0) std::printf("everything held\n");
  return failures;
}

}  // namespace nodal::crash
