// nodald --scan on the kernel's driver: what it prints is a rig.toml that nodald accepts and films with. Runs in the
// guest; writes rig.toml, scan.json and raymap.jpg to the current folder.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
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

}  // namespace
}  // namespace nodal::hil
