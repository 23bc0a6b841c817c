// The whole rig on the kernel's driver: nodald captures ten NTSC heads of vivid, five of which deliver each field by
// itself, gets a calibration, and nodal pulls raymaps. Runs in the guest; writes raymap.jpg, status.json, heads.json
// and nodald.log to the current folder.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "vivid.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

constexpr int kHeads = 10;
constexpr double kRate = 30000.0 / 1001;
const std::string kScratch = "/tmp/ten-heads";  // the guest's memory, because the current folder takes no sockets

std::string rig_toml(int heads) {
  std::ostringstream text;
  text << "[rig]\nname = \"ten-heads\"\n[raymap]\nwidth = 512\nheight = 256\n[trigger]\nsource = \"none\"\n"
       << "[links]\nunix = \"" << kScratch << "/nodal.sock\"\n[store]\nfolder = \"" << kScratch << "/store\"\n"
       << ntsc_heads_toml(heads);
  return text.str();
}

class TenHeads : public testing::Test {
 protected:
  TenHeads() {
    std::filesystem::remove_all(kScratch);  // with the calibration that another test's rig stored
    std::filesystem::create_directories(kScratch);
  }

  static Finished run(std::vector<std::string> words) { return Process(words).wait(); }
  static Finished nodald_check(const std::string& toml) {
    std::ofstream(kScratch + "/rig.toml") << toml;
    return run({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml", "--check"});
  }
  static Json nodal(std::vector<std::string> words) {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + kScratch + "/nodal.sock", "--json"});
    const Finished done = run(words);
    if (done.code != 0) throw std::runtime_error(words[4] + ": " + done.out + done.err);
    return Json::parse(done.out.substr(0, done.out.find('\n')));
  }
  /// How often each thread of a process has slept so far, by name; threads of one name are added up.
  static std::map<std::string, std::int64_t> sleeps(pid_t process) {
    std::map<std::string, std::int64_t> all;
    for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
      std::ifstream status(task.path() / "status");
      std::string key, name;
      status >> key >> name;
      std::int64_t count = 0;
      while (status >> key && key != "voluntary_ctxt_switches:") continue;
      if (status >> count) all[name] += count;
    }
    return all;
  }
  /// How often each thread wakes in a second, in 10 s without a host, or with one that pulls raymaps.
  static Json wakes_a_second(pid_t process, bool pulled) {
    const auto before = sleeps(process);
    const Json from = nodal({"status"});
    if (pulled) {
      nodal({"raymap", "pull", "--for", "10s", "--out", kScratch + "/raymap.jpg"});
    } else {
      run({"sleep", "10"});
    }
    const double seconds = (nodal({"status"})["uptime_ns"].get<double>() - from["uptime_ns"].get<double>()) / 1e9;
    Json wakes;
    for (const auto& [name, count] : sleeps(process)) {
      const auto old = before.find(name);
      wakes[name] = static_cast<double>(count - (old == before.end() ? 0 : old->second)) / seconds;
    }
    return wakes;
  }
  static std::int64_t sum(const Json& counts) {
    std::int64_t all = 0;
    for (const auto& [reason, count] : counts.items()) all += count.get<std::int64_t>();
    return all;
  }
};

TEST_F(TenHeads, Check_SaysThatTheRigIsFineOrWhichDeviceIsMissing) {
  const Finished fine = nodald_check(rig_toml(kHeads));
  EXPECT_EQ(fine.code, 0) << fine.err;
  const Finished missing = nodald_check(rig_toml(kHeads + 1));
  EXPECT_EQ(missing.code, 2);
  EXPECT_NE(missing.err.find("head 'cam10' (line "), std::string::npos) << missing.err;
  EXPECT_NE(missing.err.find("v4l2:platform:vivid-009 (vivid)"), std::string::npos) << missing.err;
}

TEST_F(TenHeads, TenSecondsOfRaymaps_EveryFrameAndEverySetIsAccountedFor) {
  ASSERT_EQ(nodald_check(rig_toml(kHeads)).code, 0);
  Process rig({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml"});
  ASSERT_TRUE(test::wait_until([] { return std::filesystem::exists(kScratch + "/nodal.sock"); })) << rig.complained();
  nodal({"--timeout", "2min", "calibration", "upload", NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"});
  ASSERT_TRUE(test::wait_until([] { return nodal({"status"})["full_sets"].get<int>() > 30; }));

  const Json heads_before = nodal({"heads"});
  const Json before = nodal({"status"});
  const Json pulled = nodal({"raymap", "pull", "--complete", "--for", "10s", "--out", "raymap.jpg"});
  const Json heads = nodal({"heads"});
  const Json after = nodal({"status"});
  std::ofstream("status.json") << before.dump() << "\n" << after.dump() << "\n" << pulled.dump() << "\n";
  std::ofstream("heads.json") << heads.dump() << "\n";

  const double seconds = (after["uptime_ns"].get<double>() - before["uptime_ns"].get<double>()) / 1e9;
  EXPECT_GE(seconds, 10);
  const auto number = [](const Json& status, const char* key) { return status[key].get<std::int64_t>(); };
  const auto grown = [&](const char* key) { return number(after, key) - number(before, key); };

  // No head lost a frame below capture: their number follows from the standard's rate.
  ASSERT_EQ(heads["heads"].size(), static_cast<std::size_t>(kHeads));
  for (std::size_t i = 0; i < kHeads; ++i) {
    const Json& head = heads["heads"][i];
    const auto frames = number(head, "frames") - number(heads_before["heads"][i], "frames");
    EXPECT_NEAR(static_cast<double>(frames), seconds * kRate, 4) << head;
    EXPECT_EQ(number(head, "opened"), 1) << head;
    EXPECT_EQ(head["trigger"], "free") << head;
    EXPECT_EQ(head["problem"], "") << head;
  }
  // Every frame is in a set, held, or lost with a reason; every slot of a set is filled or was missed by its head.
  EXPECT_EQ(number(after, "frames_taken"),
            number(after, "frames_in_sets") + number(after, "frames_held") + sum(after["losses"]));
  std::int64_t missed = 0;
  for (const Json& head : heads["heads"]) missed += number(head, "missing_sets");
  EXPECT_NEAR(static_cast<double>(number(after, "frames_in_sets") + missed),
              static_cast<double>(kHeads * number(after, "sets")), kHeads * 3);  // sets made between the two replies
  // Every set became a raymap or was skipped with a reason.
  EXPECT_NEAR(static_cast<double>(number(after, "sets")),
              static_cast<double>(number(after, "raymaps") + sum(after["set_losses"])), 3);
  EXPECT_NEAR(static_cast<double>(grown("sets")), seconds * kRate, 6);
  EXPECT_GT(grown("raymaps"), 100);

  // One head's stream fails: it is restarted and reported, and the rig continues.
  set_vivid(3, kFatalError, 1);
  ASSERT_TRUE(test::wait_until([] {
    return nodal({"heads"})["heads"][3]["problem"].get<std::string>().find("started again, 1 times") !=
           std::string::npos;
  })) << nodal({"heads"})["heads"][3];
  const auto frames = number(nodal({"heads"})["heads"][3], "frames");
  EXPECT_TRUE(test::wait_until([&] { return number(nodal({"heads"})["heads"][3], "frames") > frames + 30; }));

  rig.signal(15);
  const Finished ended = rig.wait();
  std::ofstream("nodald.log") << ended.err;
  EXPECT_EQ(ended.code, 0) << ended.err;
}

// The guest's clock stands while it computes, so these counts depend on events alone.
TEST_F(TenHeads, ThreadsWakeForFramesAndSetsAndForNothingElse) {
  ASSERT_EQ(nodald_check(rig_toml(kHeads)).code, 0);
  Process rig({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml"});
  ASSERT_TRUE(test::wait_until([] { return std::filesystem::exists(kScratch + "/nodal.sock"); })) << rig.complained();
  ASSERT_TRUE(test::wait_until([] { return nodal({"status"})["frames_taken"].get<int>() > 300; }));
  const Json idle = wakes_a_second(rig.pid(), false);
  nodal({"--timeout", "2min", "calibration", "upload", NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"});
  ASSERT_TRUE(test::wait_until([] { return nodal({"status"})["full_sets"].get<int>() > 30; }));
  const Json filming = wakes_a_second(rig.pid(), true);
  std::ofstream("wakes.json") << idle.dump() << "\n" << filming.dump() << "\n";

  // Before a calibration, capture wakes for frames (at most once for each), sets and returned buffers; then also for
  // raymaps.
  const auto rate = [](const Json& wakes, const char* thread) { return wakes.value(thread, 0.0); };
  EXPECT_GE(rate(idle, "nodal-capture"), kRate * 0.9);
  EXPECT_LE(rate(idle, "nodal-capture"), (kHeads + 2) * kRate);
  EXPECT_LE(rate(filming, "nodal-capture"), (kHeads + 4) * kRate);
  EXPECT_LE(rate(idle, "nodal-blend") + rate(idle, "nodal-encode"), kRate * 2.2);  // each set passes both, at most
  EXPECT_LE(rate(filming, "nodal-blend") + rate(filming, "nodal-encode"), kRate * 8);
  EXPECT_LE(rate(idle, "nodal-control"), 50 + kRate * 1.2);  // every 20 ms, and the bell of a set
  EXPECT_LE(rate(filming, "nodal-control"), 50 + kRate * 4);
}

}  // namespace
}  // namespace nodal::hil
