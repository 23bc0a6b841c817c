// nodald's memory on the board while it films the reference rigs for a host that pulls JPEGs.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "tests/bench/replayed_rig.h"

namespace nodal::bench {
namespace {

constexpr double kMiB = 1024.0 * 1024.0;

/// In MiB, by /proc/PID/status.
struct Resident {
  double now = 0;   ///< total
  double own = 0;   ///< without the code of programs and libraries
  double most = 0;  ///< maximum since the start
};

Resident resident(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  Resident found;
  for (std::string key, rest; status >> key && std::getline(status, rest);) {
    if (key == "VmRSS:") found.now = std::stod(rest) / 1024;
    if (key == "RssAnon:") found.own = std::stod(rest) / 1024;
    if (key == "VmHWM:") found.most = std::stod(rest) / 1024;
  }
  return found;
}

/// Measures after three calibrations, two of which were uploaded while another one was in use, and raymaps with each.
/// One picture per head is included, because a camera's driver also keeps its frames in memory.
/// The rate is one that a busy machine follows: while a raymap waits for its JPEG, the next one needs another buffer,
/// and buffers are kept.
Resident memory_of(const Workload& work) {
  ReplayedRig rig(work, PixelFormat::kI420, false, "5");
  const auto daemon = rig.start();
  const auto say = [&](const char* when) {
    const Resident found = resident(daemon->pid());
    std::printf("%-4s %-8s %6.1f MiB, of it %5.1f without code, with %4.1f of heads' pictures; at most %6.1f\n",
                work.name.c_str(), when, found.now, found.own, static_cast<double>(rig.picture_bytes()) / kMiB,
                found.most);
    return found;
  };
  Resident last = say("started");
  for (const char* name : {"first", "second", "third"}) {
    rig.upload(name);
    rig.nodal({"raymap", "pull", "-n", "10", "--out", (rig.folder() / "%04d.jpg").string()});
    last = say(name);
  }
  return last;
}

TEST(ResidentMemory, TenHeadsInto2048_FitInto38MiB) { EXPECT_LT(memory_of(r10()).now, 38); }

TEST(ResidentMemory, EightFisheyesInto3840_FitInto105MiB) { EXPECT_LT(memory_of(r8()).now, 105); }

}  // namespace
}  // namespace nodal::bench
