// nodald with its trigger and panel on gpio-sim: a crash, a line that disappears, wrong lines.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "gpio_sim.h"
#include "tests/support/process.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

const std::string kScratch = "/tmp/gpio-rig";  // a folder in the guest's memory

class GpioRig : public testing::Test {
 protected:
  GpioRig() {
    std::filesystem::remove_all(kScratch);
    std::filesystem::create_directories(kScratch);
  }

  /// Two simulated heads; lines 1 trigger, 2 status, 3 tally (on when low), 4 button.
  std::string rig_toml() const {
    const auto line = [&](int offset) { return "\"gpio:" + chip_.name() + ":" + std::to_string(offset); };
    std::ostringstream text;
    text << "[rig]\nname = \"gpio-rig\"\nrate = \"20\"\n[raymap]\nwidth = 256\nheight = 128\n"
         << "[trigger]\nstart = true\npulse_width_us = 40000\nport = " << line(1) << "\"\n"
         << "[panel]\nstatus = " << line(2) << "\"\ntally = " << line(3) << ",low\"\nbutton = " << line(4) << "\"\n"
         << "[links]\nunix = \"" << kScratch << "/nodal.sock\"\n[store]\nfolder = \"" << kScratch << "/store\"\n"
         << "[sim]\ncalibration = \"" NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json\"\nscene = \"constant\"\n";
    for (const char* head : {"cam0", "cam1"}) {
      text << "[[heads]]\nname = \"" << head << "\"\nport = \"sim:" << head << "\"\n";
    }
    return text.str();
  }
  std::string config() const { return kScratch + "/rig.toml"; }
  void write(const std::string& toml) const { std::ofstream(config()) << toml; }
  std::vector<std::string> nodald(const std::string& option = "") const {
    std::vector<std::string> words{NODAL_BIN_DIR "/nodald", "--config", config()};
    if (!option.empty()) words.push_back(option);
    return words;
  }
  static bool up() { return std::filesystem::exists(kScratch + "/nodal.sock"); }
  static Json status() {
    const Finished done =
        Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + kScratch + "/nodal.sock", "--json", "status"}).wait();
    if (done.code != 0) throw std::runtime_error(done.out + done.err);
    return Json::parse(done.out.substr(0, done.out.find('\n')));
  }
  static std::int64_t triggers() { return status()["genlock"]["triggers"].get<std::int64_t>(); }
  static std::string genlock() { return status()["genlock"]["state"].get<std::string>(); }

  SimChip chip_{"rig", 8};
};

TEST_F(GpioRig, KilledWhileItsOutputsAreOn_SafeLevelsPutsThemOff) {
  write(rig_toml());
  chip_.drive(2, true);  // after the line is released, its level or its pull switches the lamp on
  Process rig(nodald());
  ASSERT_TRUE(test::wait_until(up)) << rig.complained();
  // During a pulse, which lasts 40 of 50 ms, with the lamp on.
  ASSERT_TRUE(test::wait_until([&] { return chip_.wire(1) && chip_.wire(2); })) << rig.complained();
  rig.signal(SIGKILL);
  EXPECT_EQ(rig.wait().code, 128 + SIGKILL);
  ASSERT_TRUE(chip_.wire(1) || chip_.wire(2)) << "the kernel put them off by itself, so this test shows nothing";

  const Finished safe = Process(nodald("--safe-levels")).wait();
  EXPECT_EQ(safe.code, 0) << safe.err;
  EXPECT_FALSE(chip_.wire(1));
  EXPECT_FALSE(chip_.wire(2));
  EXPECT_TRUE(chip_.wire(3)) << "on when low";
  EXPECT_NE(safe.err.find("gpio:" + chip_.name() + ":3 is at its safe level, high"), std::string::npos) << safe.err;
}

TEST_F(GpioRig, CleanEnd_LeavesEveryOutputOff) {
  write(rig_toml());
  Process rig(nodald());
  ASSERT_TRUE(test::wait_until(up)) << rig.complained();
  ASSERT_TRUE(test::wait_until([&] { return chip_.wire(1) && chip_.wire(2); }));
  rig.signal(SIGTERM);
  EXPECT_EQ(rig.wait().code, 0) << rig.complained();
  EXPECT_FALSE(chip_.wire(1));
  EXPECT_FALSE(chip_.wire(2));
  EXPECT_TRUE(chip_.wire(3));
}

TEST_F(GpioRig, ChipTakenAwayWhileItRuns_GenlockIsLostAndNoFrameIs) {
  write(rig_toml());
  Process rig(nodald());
  ASSERT_TRUE(test::wait_until(up)) << rig.complained();
  ASSERT_TRUE(test::wait_until([&] { return genlock() == "locked"; })) << status().dump();
  chip_.remove();
  ASSERT_TRUE(test::wait_until([&] { return genlock() == "lost"; })) << status().dump();
  const Json before = status();
  wait_for(Duration::seconds(5));
  const Json after = status();
  const double seconds = (after["uptime_ns"].get<double>() - before["uptime_ns"].get<double>()) / 1e9;
  const auto frames = after["frames_taken"].get<std::int64_t>() - before["frames_taken"].get<std::int64_t>();
  EXPECT_NEAR(static_cast<double>(frames), seconds * 2 * 20, 4);
  EXPECT_EQ(after["losses"], before["losses"]);
  rig.signal(SIGTERM);
  EXPECT_EQ(rig.wait().code, 0) << rig.complained();
}

TEST_F(GpioRig, LineHeldByAnotherProgram_CheckNamesItAndTheRigRunsWithoutIt) {
  write(rig_toml());
  {
    const Finished fine = Process(nodald("--check")).wait();
    EXPECT_EQ(fine.code, 0) << fine.err;
  }
  const HeldLine held(chip_.name(), 1, "gpioset");
  const Finished refused = Process(nodald("--check")).wait();
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("gpio:" + chip_.name() + ":1: busy: held by 'gpioset'"), std::string::npos) << refused.err;
  EXPECT_EQ(Process(nodald("--safe-levels")).wait().code, 3);
  Process rig(nodald());
  ASSERT_TRUE(test::wait_until(up)) << rig.complained();
  EXPECT_TRUE(test::wait_until([&] { return status()["frames_taken"].get<std::int64_t>() > 40; }));
  EXPECT_EQ(genlock(), "off");
  EXPECT_TRUE(test::wait_until([&] { return chip_.wire(2); })) << "the lamp works";
  EXPECT_NE(rig.complained().find("held by 'gpioset'"), std::string::npos) << rig.complained();
}

TEST_F(GpioRig, ButtonPressed_StartsTheGenlock) {
  std::string toml = rig_toml();
  const std::string start = "start = true\n";
  toml.erase(toml.find(start), start.size());
  write(toml);
  Process rig(nodald());
  ASSERT_TRUE(test::wait_until(up)) << rig.complained();
  EXPECT_EQ(triggers(), 0);
  for (const bool high : {true, false, true, false, true}) chip_.drive(4, high);  // simulates contact bounce
  EXPECT_TRUE(test::wait_until([&] { return triggers() > 20; })) << status().dump();
  chip_.drive(4, false);
}

}  // namespace
}  // namespace nodal::hil
