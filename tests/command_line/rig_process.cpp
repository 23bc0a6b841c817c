#include "rig_process.h"

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <numbers>
#include <sstream>

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

const char* const kRigToml = R"([rig]
name = "six"
rate = "25"
[raymap]
width = 256
height = 128
[links]
unix = "nodal.sock"
[store]
folder = "store"
[sim]
calibration = "truth.json"
)";

}  // namespace

Calibration six_heads(const std::string& name, int side) {
  // Rows are the head's axes in the rig frame: right, down, forward.
  const std::array<std::array<double, 9>, 6> places{{{1, 0, 0, 0, 1, 0, 0, 0, 1},
                                                     {0, 0, -1, 0, 1, 0, 1, 0, 0},
                                                     {-1, 0, 0, 0, 1, 0, 0, 0, -1},
                                                     {0, 0, 1, 0, 1, 0, -1, 0, 0},
                                                     {1, 0, 0, 0, 0, 1, 0, -1, 0},
                                                     {1, 0, 0, 0, 0, -1, 0, 1, 0}}};
  Calibration calibration;
  calibration.name = name;
  for (std::size_t i = 0; i < places.size(); ++i) {
    HeadCalibration head;
    head.name = "cam" + std::to_string(i);
    head.width = head.height = side;
    head.center_x = head.center_y = side / 2.0;
    head.lens = RectilinearLens{{side / 2.0 / std::tan(50 * std::numbers::pi / 180)}};
    head.R_head_rig = places[i];
    head.region = {0, 0, static_cast<double>(side), static_cast<double>(side), {}};
    head.vignetting = {side / 2.0, side / 2.0, side / 2.0, {}};
    calibration.heads.push_back(head);
  }
  return calibration;
}

RigTest::RigTest() {
  std::string name = (fs::temp_directory_path() / "nodal-rig-XXXXXX").string();
  folder_ = ::mkdtemp(name.data());
  std::string toml = kRigToml;
  for (int i = 0; i < 6; ++i) {
    toml += "[[heads]]\nname = \"cam" + std::to_string(i) + "\"\nport = \"sim:cam" + std::to_string(i) + "\"\n";
  }
  write("rig.toml", toml);
  write("truth.json", to_json(six_heads("truth")));
  write("six.json", to_json(six_heads("six")));
  environment_["NODAL_RIG"] = "unix:" + path("nodal.sock");
  environment_["TERM"] = "dumb";
}

RigTest::~RigTest() {
  nodald_.reset();
  fs::remove_all(folder_);
}

void RigTest::start_nodald() {
  Words words = under_;
  words.insert(words.end(), {NODAL_BIN_DIR "/nodald", "--config", path("rig.toml"), "--blend-threads", "1"});
  nodald_.reset();  // before the new one starts, which refuses a socket that somebody listens on
  nodald_ = std::make_unique<Process>(words, environment_);
  const bool up = wait_until([this] { return nodal({"status"}).code == 0; });
  ASSERT_TRUE(up) << nodald_->wait(std::chrono::seconds(1)).err;
}

Finished RigTest::nodal(Words words) const { return start(std::move(words))->wait(); }

std::unique_ptr<Process> RigTest::start(Words words) const {
  words.insert(words.begin(), NODAL_BIN_DIR "/nodal");
  words.insert(words.begin(), under_.begin(), under_.end());
  return std::make_unique<Process>(words, environment_);
}

std::vector<Json> RigTest::nodal_json(Words words) const {
  words.insert(words.begin(), "--json");
  const Finished finished = nodal(words);
  EXPECT_EQ(finished.code, 0) << finished.err;
  std::vector<Json> documents;
  std::istringstream lines(finished.out);
  for (std::string line; std::getline(lines, line);) documents.push_back(Json::parse(line));
  return documents;
}

void RigTest::wait_until_durable() const {
  // A second later, sets of now are no longer on their way to the files, which the next sync then makes durable.
  const auto later = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  ASSERT_TRUE(wait_until([&] {
    const std::chrono::nanoseconds since = std::chrono::steady_clock::now() - later;  // before the rig says its age
    const Json age = nodal_json({"status"}).at(0)["recording"]["durable_ns"];
    return age.is_number() && age.get<std::int64_t>() < since.count();
  }));
}

void RigTest::start_rig_with_takes() {
  std::string toml = read("rig.toml");
  const std::string links = "[sim]\n";
  toml.replace(toml.find(links), links.size(), "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n" + links);
  write("rig.toml", toml);
  start_nodald();
  bring_up();
}

void RigTest::bring_up() const {
  const Finished uploaded = nodal({"calibration", "upload", path("six.json")});
  ASSERT_EQ(uploaded.code, 0) << uploaded.err;
  ASSERT_EQ(nodal({"genlock", "start"}).code, 0);
  ASSERT_TRUE(wait_until([this] { return nodal_json({"genlock", "show"}).at(0)["state"] == "locked"; }));
}

void RigTest::fake_ssh(const std::string& script) {
  std::string text = "#!/bin/sh\n" + script;
  const std::string bridge = NODAL_BIN_DIR "/nodald --bridge --socket " + path("nodal.sock");
  for (std::size_t at = 0; (at = text.find("BRIDGE", at)) != std::string::npos; at += bridge.size()) {
    text.replace(at, 6, bridge);
  }
  write("ssh", text);
  fs::permissions(path("ssh"), fs::perms::owner_all);
  environment_["NODAL_SSH"] = path("ssh");
  environment_["NODAL_RIG"] = "ssh://somebody@rig.local:2222";
}

std::string RigTest::write(const std::string& name, const std::string& content) const {
  std::ofstream file(path(name), std::ios::binary);
  file << content;
  EXPECT_TRUE(file.good());
  return path(name);
}

std::string RigTest::read(const std::string& name) const {
  std::ifstream file(path(name), std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace nodal::command_line
