// A board of 512 MiB with ten NTSC heads, whose card comes from a stranger: while nodald recovers the card's takes,
// which need most memory to read, it films a take of its own and loses nothing. Runs in the guest; writes memory.json
// and nodald.log to the current folder.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/foreign_takes.h"
#include "tests/support/process.h"
#include "vivid.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

constexpr int kBoardHeads = 10;
constexpr double kBoardRate = 30000.0 / 1001;
const std::string kBoard = "/tmp/small-board";  // the guest's memory, for small files and the socket
const std::string kCard = kBoard + "/card";

/// A number of /proc/meminfo or /proc/vmstat, by the first word of its line; -1 if it has none.
std::int64_t kernel_number(const std::string& file, const std::string& key) {
  std::ifstream in("/proc/" + file);
  std::string word;
  for (std::int64_t number = 0; in >> word >> number; in.ignore(100, '\n')) {
    if (word == key) return number;
  }
  return -1;
}

std::int64_t most_resident_kib(pid_t process) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  std::string key;
  for (std::int64_t number = 0; status >> key; status.ignore(1000, '\n')) {
    if (key == "VmHWM:" && status >> number) return number;
  }
  return -1;
}

int shell(const std::string& line) { return std::system(line.c_str()); }

/// The card is an ext4 file system on this machine's disk, not in the guest's memory.
class SmallBoard : public testing::Test {
 protected:
  SmallBoard() {
    std::filesystem::create_directories(kCard);
    EXPECT_EQ(shell("truncate -s 8G card.img && mkfs.ext4 -q -F card.img && mount -o loop card.img " + kCard), 0);
    std::ofstream toml(kBoard + "/rig.toml");
    toml << "[rig]\nname = \"small-board\"\n[raymap]\nwidth = 512\nheight = 256\n[trigger]\nsource = \"none\"\n"
         << "[links]\nunix = \"" << kBoard << "/nodal.sock\"\n[store]\nfolder = \"" << kBoard << "/store\"\n"
         << "[takes]\nfolder = \"" << kCard << "/takes\"\nbuffer_mb = 64\nmode = \"jpeg\"\n"
         << ntsc_heads_toml(kBoardHeads);
  }
  ~SmallBoard() override { (void)shell("umount " + kCard + " && rm -f card.img"); }

  static std::optional<Json> try_nodal(std::vector<std::string> words) {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + kBoard + "/nodal.sock", "--json"});
    const Finished done = Process(words).wait();
    if (done.code != 0) {
      ADD_FAILURE() << words.back() << ": " << done.out << done.err;
      return std::nullopt;
    }
    return Json::parse(done.out.substr(0, done.out.find('\n')));
  }
  static bool listens(Process& rig) {
    const bool present = test::wait_until([] { return std::filesystem::exists(kBoard + "/nodal.sock"); });
    EXPECT_TRUE(present) << rig.complained();
    return present;
  }
};

TEST_F(SmallBoard, AStrangersCardIsRecovered_TheRigFilmsMeanwhileAndLosesNothing) {
  std::filesystem::create_directories(kCard + "/takes");
  const std::vector<std::string> command{NODAL_BIN_DIR "/nodald", "--config", kBoard + "/rig.toml"};
  {
    Process rig(command);
    ASSERT_TRUE(listens(rig));
    ASSERT_TRUE(try_nodal(
        {"--timeout", "2min", "calibration", "upload", NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"}));
    rig.signal(15);
    ASSERT_EQ(rig.wait().code, 0);
  }
  test::put_foreign_takes(kCard + "/takes");
  ASSERT_EQ(shell("sync; echo 3 > /proc/sys/vm/drop_caches"), 0);

  Process rig(command);
  ASSERT_TRUE(listens(rig));
  wait_for(Duration::seconds(1));
  const auto started = try_nodal({"take", "start"});
  ASSERT_TRUE(started) << rig.complained();
  const std::int64_t total = kernel_number("meminfo", "MemTotal:");
  std::int64_t least_available = total;
  Json takes;
  const auto state_of = [&](std::uint64_t number) {
    const auto found = std::ranges::find_if(takes, [&](const Json& take) { return take["take"] == number; });
    return found == takes.end() ? std::string() : (*found)["state"].get<std::string>();
  };
  // The guest's clock stands while it computes, so each look at the rig waits first.
  const auto done = [&] {
    return std::ranges::any_of(takes, [](const Json& take) { return take["state"] == "recording"; }) &&
           std::ranges::none_of(takes, [](const Json& take) { return take["state"] == "unfinished"; });
  };
  for (int second = 0; second < 60 && (second < 8 || !done()); ++second) {
    wait_for(Duration::seconds(1));
    least_available = std::min(least_available, kernel_number("meminfo", "MemAvailable:"));
    const auto listed = try_nodal({"take", "list"});
    ASSERT_TRUE(listed) << rig.complained();
    takes = (*listed)["takes"];
  }
  EXPECT_TRUE(done()) << takes;
  EXPECT_TRUE(try_nodal({"take", "stop"}));
  takes = (*try_nodal({"take", "list"}))["takes"];
  const std::int64_t most = most_resident_kib(rig.pid());
  rig.signal(15);
  const Finished ended = rig.wait();
  std::ofstream("nodald.log") << ended.err;
  EXPECT_EQ(ended.code, 0) << ended.err;

  EXPECT_EQ(state_of(1), "complete") << takes;
  EXPECT_EQ(state_of(2), "damaged") << takes;
  EXPECT_EQ(state_of(3), "complete") << takes;
  EXPECT_EQ(state_of(4), "complete") << takes;
  const Json& own = *std::ranges::find_if(takes, [&](const Json& take) { return take["take"] == (*started)["take"]; });
  EXPECT_EQ(own["state"], "complete") << own;
  EXPECT_EQ(own["lost_sets"], 0) << own;
  EXPECT_EQ(own["gaps"], 0) << own;
  const double seconds = own["length_ns"].get<double>() / 1e9;
  EXPECT_GT(seconds, 5);
  EXPECT_NEAR(own["sets"].get<double>(), seconds * kBoardRate, 3) << own;
  EXPECT_EQ(kernel_number("vmstat", "oom_kill"), 0) << "the kernel ended a process for lack of memory";
  EXPECT_LE(total, 512 * 1024);
  const Json memory{{"total_kib", total},
                    {"least_available_kib", least_available},
                    {"nodald_most_resident_kib", most},
                    {"seconds", seconds}};
  std::ofstream("memory.json") << memory.dump() << "\n";
  std::cout << memory.dump() << "\n";
}

}  // namespace
}  // namespace nodal::hil
