// nodald --scan on the kernel's driver: what it prints is a rig.toml that nodald accepts and films with. Runs in the
// guest; writes rig.toml, scan.json and raymap.jpg to the current folder.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "vivid.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

const std::string kScratch = "/tmp/scan";  // the guest's memory, because the current folder takes no sockets

Finished run(const std::vector<std::string>& words) { return Process(words).wait(); }

/// The kernel's command line gives three S-Video inputs, whose standard is PAL until somebody sets another, and a
/// webcam.
TEST(Scan, OfThreeAnalogueHeadsAndAWebcam_IsARigTomlThatFilms) {
  std::filesystem::create_directories(kScratch);
  const Finished scanned = run({NODAL_BIN_DIR "/nodald", "--scan"});
  ASSERT_EQ(scanned.code, 0) << scanned.err;
  std::ofstream("rig.toml") << scanned.out;
  const Finished json = run({NODAL_BIN_DIR "/nodald", "--scan", "--json"});
  ASSERT_EQ(json.code, 0) << json.err;
  std::ofstream("scan.json") << json.out;

  const Json found = Json::parse(json.out);
  ASSERT_EQ(found["devices"].size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Json& device = found["devices"][i];
    EXPECT_EQ(device["port"], vivid_path(static_cast<int>(i)));
    EXPECT_EQ(device["model"], "vivid");
    EXPECT_EQ(device["standard"], "25/1");
    EXPECT_EQ(device["head"]["width"], 720);
    EXPECT_EQ(device["head"]["height"], 576);
  }
  EXPECT_EQ(found["devices"][3]["standard"], nullptr);
  EXPECT_EQ(found["devices"][3]["head"]["width"], 640)
      << "the largest of the webcam's sizes at PAL's 25 frames a second";
  EXPECT_NE(scanned.out.find("fields = \"top-first\""), std::string::npos) << "PAL";

  // The scan's own text, with places of this test for socket and store in front of its first table.
  std::string toml = scanned.out;
  toml.insert(toml.find("[raymap]") + 9, "width = 512\nheight = 256\n");
  toml.insert(toml.find("[rig]"),
              "[links]\nunix = \"" + kScratch + "/nodal.sock\"\n[store]\nfolder = \"" + kScratch + "/store\"\n");
  std::ofstream(kScratch + "/rig.toml") << toml;
  const Finished check = run({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml", "--check"});
  ASSERT_EQ(check.code, 0) << check.err << toml;

  std::ifstream example(NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json");
  Json calibration = Json::parse(example);
  calibration["heads"].erase(calibration["heads"].begin() + 4, calibration["heads"].end());
  for (std::size_t i = 0; i < 4; ++i) {
    Json& head = calibration["heads"][i];
    head["width"] = head["region"]["right"] = i < 3 ? 720 : 640;
    head["height"] = head["region"]["bottom"] = i < 3 ? 576 : 480;
  }
  std::ofstream(kScratch + "/rig.json") << calibration;

  Process rig({NODAL_BIN_DIR "/nodald", "--config", kScratch + "/rig.toml"});
  ASSERT_TRUE(test::wait_until([] { return std::filesystem::exists(kScratch + "/nodal.sock"); })) << rig.complained();
  const auto nodal = [](std::vector<std::string> words) {
    words.insert(words.begin(), {NODAL_BIN_DIR "/nodal", "--rig", "unix:" + kScratch + "/nodal.sock"});
    return run(words);
  };
  const Finished upload = nodal({"--timeout", "2min", "calibration", "upload", kScratch + "/rig.json"});
  ASSERT_EQ(upload.code, 0) << upload.err;
  const Finished pull = nodal({"--timeout", "2min", "raymap", "pull", "--complete", "-n", "5", "--out", "raymap.jpg"});
  EXPECT_EQ(pull.code, 0) << pull.err << rig.complained();
  EXPECT_GT(std::filesystem::file_size("raymap.jpg"), 2000U);
  // While nodald uses the devices, they still answer; a host gets what the board itself prints.
  const Finished here = run({NODAL_BIN_DIR "/nodald", "--scan"});
  EXPECT_NE(here.out.find("[[heads]]"), std::string::npos);
  const Finished finished = nodal({"heads", "scan"});
  EXPECT_EQ(finished.code, 0) << finished.err;
  EXPECT_EQ(finished.out, here.out);
  EXPECT_EQ(Json::parse(nodal({"--json", "heads", "scan"}).out),
            Json::parse(run({NODAL_BIN_DIR "/nodald", "--scan", "--json"}).out));
  rig.signal(15);
  EXPECT_EQ(rig.wait().code, 0);
}

/// The commands of the guide "From USB cameras to a film".
std::vector<std::string> guide() {
  std::ifstream page(NODAL_SOURCE_DIR "/host_tool/USB_CAMERAS.md");
  std::vector<std::string> commands;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("    ")) commands.push_back(line.substr(4));
  }
  return commands;
}

/// The rig as it was scanned, without an editor. What vivid shows is bars, the same in all heads: nothing to find
/// lenses and directions in, so that what `nodal register` would find is written here.
TEST(Scan, EveryCommandOfTheGuide_MakesAFilm) {
  const std::string folder = "/tmp/guide";
  std::filesystem::create_directories(folder);
  const std::map<std::string, std::string> environment{{"PATH", std::string(NODAL_BIN_DIR) + ":/usr/bin:/bin"},
                                                       {"HOME", folder},
                                                       {"XDG_STATE_HOME", folder + "/state"},
                                                       {"NODAL_OVERWRITE", "0"}};
  const auto type = [&](const std::string& command) {
    return Process({"sh", "-c", "cd " + folder + " && " + command}, environment).wait();
  };
  std::ofstream transcript("guide.txt");
  const auto tell = [&](const std::string& command, const Finished& run) {
    transcript << "$ " << command << "\n" << run.out << run.err << "[" << run.code << "]\n" << std::flush;
    return run.out + run.err;
  };
  std::unique_ptr<Process> rig;
  int films = 0;
  for (const std::string& command : guide()) {
    if (command.starts_with("export")) continue;
    if (command.ends_with("&")) {
      rig = std::make_unique<Process>(
          std::vector<std::string>{"sh", "-c", "cd " + folder + " && exec " + command.substr(0, command.size() - 1)},
          environment);
      ASSERT_TRUE(test::wait_until([&] { return type("nodal status").code == 0; })) << rig->complained();
      continue;
    }
    if (command.starts_with("nodal register")) {
      const Finished run = type(command);
      const std::string said = tell(command, run);
      EXPECT_NE(run.code, 0) << said;
      EXPECT_NE(said.find("show the same things"), std::string::npos) << said;
      if (command.find("first.json") == std::string::npos) continue;
      std::ifstream example(NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json");
      Json calibration = Json::parse(example);
      const Json heads = Json::parse(type("nodal --json heads").out)["heads"];
      calibration["heads"].erase(calibration["heads"].begin() + static_cast<std::ptrdiff_t>(heads.size()),
                                 calibration["heads"].end());
      for (std::size_t i = 0; i < heads.size(); ++i) {
        Json& head = calibration["heads"][i];
        head["name"] = heads[i]["name"];
        head["width"] = head["region"]["right"] = i < 3 ? 720 : 640;
        head["height"] = head["region"]["bottom"] = i < 3 ? 576 : 480;
      }
      std::ofstream(folder + "/first.json") << calibration;
      continue;
    }
    const Finished run = type(command);
    const std::string said = tell(command, run);
    if (command.starts_with("nodal drift")) {
      EXPECT_EQ(run.code, 10) << said;
      continue;
    }
    EXPECT_EQ(run.code, 0) << command << "\n" << said << (rig ? rig->complained() : "");
    films += command.starts_with("nodal render") ? 1 : 0;
  }
  EXPECT_EQ(films, 1);
  EXPECT_GT(std::filesystem::file_size(folder + "/sphere.jpg"), 2000U);
  EXPECT_GT(std::filesystem::file_size(folder + "/film.mkv"), 20'000U);
  rig->signal(15);
  EXPECT_EQ(rig->wait().code, 0);
}

}  // namespace
}  // namespace nodal::hil
