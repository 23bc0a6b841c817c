// nodald.service: systemd's own rating of its sandbox, and that nodald works in it.
//
// systemd is not process 1 where tests run, so the second test builds the sandbox by hand, and says which lines it
// covers: User=, Group=, UMask=, NoNewPrivileges=, CapabilityBoundingSet=, ProtectSystem=strict with StateDirectory=
// and RuntimeDirectory= as the only places to write, ProtectHome=, PrivateDevices= (an empty /dev), PrivateNetwork=,
// PrivateMounts=, ProtectHostname=, and by seccomp SystemCallFilter= as in the unit, MemoryDenyWriteExecute=,
// RestrictNamespaces= and RestrictAddressFamilies=. Not covered are lines that only take away what nodald never uses:
// ProtectClock=, ProtectControlGroups=, ProtectKernel*=, ProtectProc=, ProcSubset=, RestrictRealtime=,
// RestrictSUIDSGID=, LockPersonality=, RemoveIPC=, KeyringMode=, IPAddressDeny=.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "nodald_process.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

constexpr uid_t kNobody = 65534;
const std::string kUnit = NODAL_SOURCE_DIR "/firmware/daemon/nodald.service";

std::string run(const std::vector<std::string>& command) {
  const test::Finished finished = test::Process(command).wait();
  EXPECT_EQ(finished.code, 0) << command.front() << ": " << finished.err;
  return finished.out;
}

using Calls = std::set<std::string>;

/// systemd's sets of system calls, from `systemd-analyze syscall-filter`: "@name", then its members, indented.
std::map<std::string, Calls> call_sets() {
  std::map<std::string, Calls> sets;
  std::istringstream lines(run({"systemd-analyze", "--no-pager", "syscall-filter"}));
  std::string name;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find_first_not_of(' ');
    if (begin == std::string::npos || line[begin] == '#') continue;
    if (begin == 0) name = line;
    else sets[name].insert(line.substr(begin));
  }
  return sets;
}

void expand(const std::map<std::string, Calls>& sets, const std::string& name, Calls& into) {
  const auto set = sets.find(name);
  if (set == sets.end()) {
    into.insert(name);
    return;
  }
  for (const std::string& member : set->second) expand(sets, member, into);
}

/// The calls that the unit's SystemCallFilter= lines permit: the first line lists, later ones add or, with ~, remove.
Calls permitted_calls() {
  const auto sets = call_sets();
  Calls permitted;
  expand(sets, "@default", permitted);  // always permitted, see systemd.exec(5)
  std::ifstream unit(kUnit);
  for (std::string line; std::getline(unit, line);) {
    constexpr std::string_view kKey = "SystemCallFilter=";
    if (!line.starts_with(kKey)) continue;
    std::string value = line.substr(kKey.size());
    const bool away = value.starts_with('~');
    if (away) value.erase(0, 1);
    std::istringstream words(value);
    for (std::string word; words >> word;) {
      Calls calls;
      expand(sets, word, calls);
      for (const std::string& call : calls) {
        if (away) permitted.erase(call);
        else permitted.insert(call);
      }
    }
  }
  return permitted;
}

/// Runs nodald in a sandbox like the unit's; it can only write to `folder`.
std::vector<std::string> confined(const RigFolder& folder) {
  const std::filesystem::path list = folder.path / "calls";
  std::ofstream out(list);
  for (const std::string& call : permitted_calls()) out << call << '\n';
  out.close();
  // The checkout may be where only its owner may look, or in /home, which the sandbox hides.
  for (const char* program : {"confine", "nodald"})
    std::filesystem::copy_file(std::filesystem::path(NODAL_BIN_DIR) / program, folder.path / program);
  const std::string store = folder.path.string();
  std::filesystem::permissions(folder.path, std::filesystem::perms::owner_all | std::filesystem::perms::others_exec |
                                                std::filesystem::perms::group_exec);
  EXPECT_EQ(::chown(folder.path.c_str(), kNobody, kNobody), 0);
  const std::string mounts = "mount --bind " + store + " " + store +
                             " && mount --bind / / && mount -o remount,ro,bind /"
                             " && mount -t tmpfs -o mode=000 none /home && mount -t tmpfs -o mode=000 none /dev"
                             " && umask 0007 && exec setpriv --reuid=65534 --regid=65534 --clear-groups"
                             " --bounding-set=-all --inh-caps=-all --no-new-privs ";
  const std::string all =
      mounts + store + "/confine " + list.string() + " " + store + "/nodald --config " + folder.config();
  return {"unshare", "--mount", "--net", "--ipc", "--uts", "--propagation", "private", "sh", "-c", all};
}

bool can_build_a_sandbox() {
  return ::geteuid() == 0 &&
         test::Process({"unshare", "--mount", "--net", "sh", "-c", "mount --bind / /"}).wait().code == 0;
}

/// systemd's rating of a unit's sandbox, from 0 (closed) to 10.
double exposure_level(const std::string& unit) {
  const std::string report = run({"systemd-analyze", "--no-pager", "security", "--offline=true", unit});
  const std::string kSays = "Overall exposure level for " + std::filesystem::path(unit).filename().string() + ": ";
  const std::size_t at = report.find(kSays);
  EXPECT_NE(at, std::string::npos) << report;
  return at == std::string::npos ? 10 : std::stod(report.substr(at + kSays.size()));
}

TEST(Service, Unit_IsAtMost1_5BySystemdsMeasure) { EXPECT_LE(exposure_level(kUnit), 1.5); }

TEST(Service, UnitWithDevices_IsAtMost1_5BySystemdsMeasureAndTheLaterLinesCount) {
  // As systemd reads a drop-in: after the unit.
  const RigFolder folder;
  const std::string both = (folder.path / "nodald.service").string();
  std::ofstream(both) << std::ifstream(kUnit).rdbuf() << '\n'
                      << std::ifstream(NODAL_SOURCE_DIR "/firmware/daemon/devices.conf").rdbuf();
  const double level = exposure_level(both);
  EXPECT_LE(level, 1.5);
  EXPECT_GT(level, exposure_level(kUnit));
}

TEST(Service, UnitOfTheCable_IsAtMost1BySystemdsMeasure) {
  EXPECT_LE(exposure_level(NODAL_SOURCE_DIR "/firmware/daemon/nodal-cable.service"), 1);
}

TEST(Service, InTheUnitsSandbox_TheRigTakesACalibrationServesAndEndsCleanly) {
  if (!can_build_a_sandbox()) GTEST_SKIP() << "needs root and the right to mount";
  const RigFolder folder;
  test::Process daemon(confined(folder));
  const auto host = LinkHost::connect(folder.socket());
  ASSERT_TRUE(host) << daemon.complained();
  const Calibration calibration = scenario::small_calibration("truth");
  ASSERT_TRUE(host->upload_and_commit(to_json(calibration)));
  wire::Request pull;
  pull.mutable_pull()->set_count(3);
  std::optional<wire::Reply> started;
  ASSERT_TRUE(test::wait_until([&] {
    started = host->ask(pull);
    return started && started->has_pull();
  })) << daemon.complained();
  while (host->raymaps < 3) ASSERT_TRUE(host->pump());

  std::ifstream status("/proc/" + std::to_string(daemon.pid()) + "/status");
  const std::string text{std::istreambuf_iterator<char>(status), {}};
  EXPECT_NE(text.find("NoNewPrivs:\t1"), std::string::npos);
  EXPECT_NE(text.find("Seccomp:\t2"), std::string::npos);
  EXPECT_NE(text.find("CapBnd:\t0000000000000000"), std::string::npos);
  EXPECT_NE(text.find("Uid:\t65534"), std::string::npos);
  for (const auto& file : std::filesystem::recursive_directory_iterator(folder.path / "store")) {
    struct stat about {};
    ASSERT_EQ(::stat(file.path().c_str(), &about), 0);
    EXPECT_EQ(about.st_mode & 0007, 0u) << file.path() << " is for others, too";
  }

  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(20)).code, 0) << daemon.complained();
}

}  // namespace
}  // namespace nodal::crash
