// `nodal offload` on a host's disk of which one call fails: the copy is complete, or the error names the file and the
// same command goes on.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "nodald_process.h"
#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;
using test::Finished;
using test::Process;

/// Every call with NODAL_OFFLOAD_PLACES=all; otherwise so many of them, at equal distances.
constexpr std::size_t kPlaces = 12;

/// A rig with one short take.
struct RigOfOneTake {
  RecordingRig folder;
  std::unique_ptr<Process> daemon = std::make_unique<Process>(nodald({"--config", folder.config()}));

  void record() const {
    const auto host = LinkHost::connect(folder.socket(), 60);
    ASSERT_TRUE(host) << daemon->complained();
    ASSERT_TRUE(host->wait_for([](const wire::RigStatus& now) { return now.sets() > 0; }));
    wire::Request start, stop;
    start.mutable_take_start();
    stop.mutable_take_stop();
    ASSERT_TRUE(host->ask(start)->has_take());
    ASSERT_TRUE(host->wait_for([](const wire::RigStatus& now) { return now.recording().sets() > 20; }));
    ASSERT_TRUE(host->ask(stop)->has_take());
  }
  Finished offload(const fs::path& to, const std::map<std::string, std::string>& environment = {}) const {
    return Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + folder.socket(), "offload", "1", "--to", to.string()},
                   environment)
        .wait();
  }
  void expect_copied(const fs::path& copy, const std::string& when) const {
    std::size_t files = 0;
    for (const auto& entry : fs::directory_iterator(folder.path / "takes" / "000001")) {
      ++files;
      const std::string name = entry.path().filename().string();
      EXPECT_TRUE(test::read_bytes(entry.path()) == test::read_bytes(copy / name)) << name << ", " << when;
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(copy), fs::directory_iterator()), static_cast<std::ptrdiff_t>(files))
        << when;
  }
};

TEST(OffloadCalls, AnyCallAboutTheCopyFails_NothingIsLostTheFileIsNamedAndTheSameCommandGoesOn) {
  const RigOfOneTake rig;
  rig.record();
  const test::TemporaryFolder scratch;
  const auto with_failure = [&](const fs::path& to, std::size_t call) {
    fs::create_directories(to);
    return rig.offload(to, {{"LD_PRELOAD", NODAL_BIN_DIR "/libfail_call.so"},
                            {"FAIL_CALL_FOLDER", to.string()},
                            {"FAIL_CALL", std::to_string(call)},
                            {"FAIL_CALL_COUNT", (to / "count").string()}});
  };
  const auto calls_of = [](const fs::path& to) {
    const std::size_t calls = fs::file_size(to / "count");
    fs::remove(to / "count");
    return calls;
  };
  constexpr std::size_t kNone = 1'000'000;
  const Finished whole = with_failure(scratch / "whole", kNone);
  ASSERT_EQ(whole.code, 0) << whole.err;
  const std::size_t calls = calls_of(scratch / "whole");
  ASSERT_GT(calls, 50U);
  rig.expect_copied(scratch / "whole" / "000001", "without a failure");
  const char* const wanted = std::getenv("NODAL_OFFLOAD_PLACES");
  const std::size_t step = wanted && std::string(wanted) == "all" ? 1 : std::max<std::size_t>(1, calls / kPlaces);
  std::size_t refused = 0;
  for (std::size_t call = 0; call < calls; call += step) {
    const fs::path to = scratch / std::to_string(call);
    const std::string when = "call " + std::to_string(call);
    const Finished first = with_failure(to, call);
    (void)calls_of(to);
    if (first.code != 0) {
      ++refused;
      EXPECT_EQ(first.code, 6) << when << ": " << first.err;
      EXPECT_NE(first.err.find(to.string()), std::string::npos) << when << ": " << first.err;
      // Only the last call of all, which makes the manifest's name durable, fails with a complete copy.
      if (fs::exists(to / "000001" / "manifest")) rig.expect_copied(to / "000001", when + ", with a manifest");
    }
    const Finished again = rig.offload(to);
    ASSERT_EQ(again.code, 0) << when << ": " << again.err;
    rig.expect_copied(to / "000001", when);
    fs::remove_all(to);
  }
  EXPECT_GE(refused, kPlaces / 2);
  EXPECT_TRUE(fs::exists(rig.folder.path / "takes" / "000001" / "manifest")) << "the rig keeps the take";
}

}  // namespace
}  // namespace nodal::crash
