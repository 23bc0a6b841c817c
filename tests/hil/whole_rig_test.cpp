// Two rigs in one guest, each on a USB cable of its own, film for 30 s. One has ten NTSC heads of vivid, which run
// free. The other has four IIDC cameras, whose trigger inputs are wired to the gpio-sim line that its nodald pulses.
// Every raymap, set, frame and pulse that is missing must have a counted reason. Runs in the guest; writes the rigs'
// replies and logs to the current folder.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <memory>
#include <sstream>

#include "cable_rig.h"
#include "gpio_sim.h"
#include "iidc_camera.h"

namespace nodal::hil {
namespace {

using Json = nlohmann::json;
using test::Finished;
using test::Process;

const std::string kPlace = "/tmp/whole-rig";  // the guest's memory, because the current folder takes no sockets
constexpr int kVividHeads = 10;
constexpr int kCameras = 4;
constexpr int kFirstCamera = 2;  // the controllers before it carry the cables
constexpr double kNtsc = 30000.0 / 1001;
constexpr double kPulseRate = 20;
constexpr std::uint32_t kTriggerLine = 1;
constexpr std::size_t kByPulse = 3;  // this camera's exposure is as long as the pulse
constexpr int kPulseUs = 10'000, kShutterUs = 5'000;

std::string beginning(const std::string& name, const std::string& cable) {
  return "[rig]\nname = \"" + name + "\"\nrate = \"" + (name == "vivid" ? "30000/1001" : "20") +
         "\"\n[links]\nunix = \"" + kPlace + "/" + name + ".sock\"\nusb = \"" + cable + "\"\n[store]\nfolder = \"" +
         kPlace + "/" + name + "\"\n";
}

std::string vivid_toml(const std::string& cable) {
  std::ostringstream text;
  text << beginning("vivid", cable) << "[raymap]\nwidth = 256\nheight = 128\nfields = \"separate\"\n"
       << "[trigger]\nsource = \"none\"\n";
  for (int i = 0; i < kVividHeads; ++i) {
    text << "[[heads]]\nname = \"cam" << i << "\"\nport = \"v4l2:platform:vivid-00" << i << "\"\nformat = \"YUYV\"\n"
         << "size = \"720x480\"\ninput = \"S-Video 0\"\nstandard = \"NTSC\"\nfields = \"bottom-first\"\n"
         << "separate_fields = " << (i % 2 == 0 ? "false" : "true") << "\n";
  }
  return text.str();
}

std::string iidc_toml(const std::string& cable, const std::string& chip,
                      const std::array<std::unique_ptr<IidcCamera>, kCameras>& cameras) {
  std::ostringstream text;
  text << beginning("iidc", cable) << "[raymap]\nwidth = 256\nheight = 128\nformat = \"GREY\"\n"
       << "[trigger]\nport = \"gpio:" << chip << ":" << kTriggerLine << "\"\npulse_width_us = " << kPulseUs
       << "\n[takes]\nfolder = \"" << kPlace << "/takes\"\nbuffer_mb = 16\n";
  for (std::size_t i = 0; i < kCameras; ++i) {
    text << "[[heads]]\nname = \"cam" << i << "\"\nport = \"" << cameras[i]->path() << "\"\nformat = \"GREY\"\n"
         << "size = \"96x64\"\nreadout_us = " << IidcCamera::kReadout.us() << "\n";
    text << (i == kByPulse ? "exposure_by = \"pulse\"\n" : "exposure_us = " + std::to_string(kShutterUs) + "\n");
  }
  return text.str();
}

/// Four equidistant fisheyes that look ahead, right, back, left.
std::string fisheyes() {
  Json calibration = {{"nodal_calibration", 1}, {"name", "fisheyes"}, {"comment", ""}, {"heads", Json::array()}};
  constexpr std::array<std::array<int, 2>, 4> kAhead{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};  // x and z of the axis
  for (int i = 0; i < kCameras; ++i) {
    const auto [x, z] = kAhead[i];
    calibration["heads"].push_back({{"name", "cam" + std::to_string(i)},
                                    {"width", 96},
                                    {"height", 64},
                                    {"center", {48, 32}},
                                    {"aspect", 1},
                                    {"lens", {{"model", "equidistant"}, {"coefficients", {45}}}},
                                    {"max_angle", 1.4},
                                    {"R_head_rig", {{z, 0, -x}, {0, 1, 0}, {x, 0, z}}},
                                    {"region", {{"left", 0}, {"top", 0}, {"right", 96}, {"bottom", 64}}},
                                    {"response", {{"curve", "linear"}}},
                                    {"vignetting", {{"x", 48}, {"y", 32}, {"radius", 60}, {"coefficients", {0, 0, 0}}}},
                                    {"gain", {{"red", 1}, {"green", 1}, {"blue", 1}}}});
  }
  return calibration.dump();
}

/// The rows of a table of `nodal take export`, by their titles.
std::vector<std::map<std::string, std::string>> table(const std::string& file) {
  const auto cells_of = [](std::string line) {
    if (line.ends_with('\r')) line.pop_back();
    std::vector<std::string> cells(1);
    for (const char c : line) c == ',' ? void(cells.emplace_back()) : cells.back().push_back(c);
    return cells;
  };
  std::vector<std::map<std::string, std::string>> rows;
  std::istringstream in(content(file));
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> titles = cells_of(line);
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = cells_of(line);
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < titles.size(); ++i) row[titles[i]] = cells.at(i);
  }
  return rows;
}

std::int64_t number(const Json& from, const char* key) { return from[key].get<std::int64_t>(); }
std::int64_t sum(const Json& counts) {
  std::int64_t all = 0;
  for (const auto& [reason, count] : counts.items()) all += count.get<std::int64_t>();
  return all;
}

/// One of the two rigs: nodald, and nodal by socket and by cable.
class Rig {
 public:
  Rig(std::string name, const CableGadget& cable, const std::string& toml) : name_(std::move(name)), cable_(cable) {
    std::ofstream(kPlace + "/" + name_ + ".toml") << toml;
    nodald_ = std::make_unique<Process>(
        std::vector<std::string>{NODAL_BIN_DIR "/nodald", "--config", kPlace + "/" + name_ + ".toml"});
    EXPECT_TRUE(test::wait_until([&] { return std::filesystem::exists(kPlace + "/" + name_ + ".sock"); }))
        << nodald_->complained();
    cable_.plug();
  }
  std::string socket() const { return "unix:" + kPlace + "/" + name_ + ".sock"; }
  std::string cable() const { return "usb:" + cable_.serial(); }
  Json ask(const std::vector<std::string>& words, const std::string& address = {}) {
    const Finished done = nodal(address.empty() ? socket() : address, words);
    if (done.code != 0)
      throw std::runtime_error(name_ + ": " + words[0] + ": " + done.out + done.err + nodald_->complained());
    return Json::parse(done.out.substr(0, done.out.find('\n')));
  }
  Json status() { return ask({"status"}); }
  Json heads() { return ask({"heads"})["heads"]; }
  /// A host on the cable that pulls raymaps for 30 s.
  std::unique_ptr<Process> puller() const {
    return std::make_unique<Process>(std::vector<std::string>{NODAL_BIN_DIR "/nodal", "--rig", cable(), "--json",
                                                              "raymap", "pull", "--for", "30s", "--out",
                                                              kPlace + "/" + name_ + ".jpg"});
  }
  void end() {
    nodald_->signal(15);
    const Finished ended = nodald_->wait();
    std::ofstream(name_ + ".log") << ended.err;
    EXPECT_EQ(ended.code, 0) << ended.err;
  }

 private:
  const std::string name_;
  const CableGadget& cable_;
  std::unique_ptr<Process> nodald_;
};

/// Every frame is in a set, held, or lost with a reason; every set is a raymap, or not with a reason.
void expect_conserved(const Json& status) {
  EXPECT_EQ(number(status, "frames_taken"),
            number(status, "frames_in_sets") + number(status, "frames_held") + sum(status["losses"]))
      << status;
  EXPECT_NEAR(static_cast<double>(number(status, "sets")),
              static_cast<double>(number(status, "raymaps")) / static_cast<double>(number(status, "raymaps_a_set")) +
                  static_cast<double>(sum(status["set_losses"])),
              2)
      << status;
}

/// The raymaps that a host received in 30 s. Between the first and the last, none is missing.
std::vector<Json> received(const Finished& pulled, double rate) {
  EXPECT_EQ(pulled.code, 0) << pulled.err;
  std::vector<Json> raymaps;
  std::istringstream in(pulled.out);
  for (std::string line; std::getline(in, line);) {
    const Json document = Json::parse(line);
    if (document.contains("raymap")) raymaps.push_back(document["raymap"]);
    if (document.contains("summary")) {
      EXPECT_EQ(number(document["summary"], "dropped"), 0) << line;
    }
  }
  EXPECT_NEAR(static_cast<double>(raymaps.size()), 30 * rate, rate / 2);
  return raymaps;
}

/// What the take says of one camera: the number of its counter less that of the pulse, as often as it changes, and the
/// sets without a frame of it.
struct Evidence {
  std::vector<std::int64_t> offsets;
  std::vector<std::size_t> missing;
  std::size_t wrong_pictures = 0;  ///< whose last row is not of this counter

  bool missing_in_one_piece() const {
    return missing.empty() || missing.back() - missing.front() + 1 == missing.size();
  }
};

class WholeRig : public testing::Test {
 protected:
  WholeRig() {
    std::filesystem::remove_all(kPlace);
    std::filesystem::create_directories(kPlace + "/takes");
    for (int i = 0; i < kCameras; ++i) plug(i);
  }
  void plug(int i) { cameras_[i] = std::make_unique<IidcCamera>(kFirstCamera + i, chip_.wire_file(kTriggerLine)); }
  static void wait_for_both(Process& a, Process& b, Duration time) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::nanoseconds(time.ns());
    while (std::chrono::steady_clock::now() < end) {
      wait_for(Duration::milliseconds(100));
      a.said();  // or their pipes fill up
      b.said();
    }
  }
  /// The take as other programs see it: nodal's tables, and the pictures by ffmpeg.
  static std::vector<Evidence> evidence(const std::vector<std::map<std::string, std::string>>& sets) {
    std::vector<Evidence> all(kCameras);
    std::vector<std::string> pictures;
    constexpr std::size_t kBytes = 96 * 64;
    for (int i = 0; i < kCameras; ++i) {
      const std::string film = kPlace + "/export/cam" + std::to_string(i);
      const Finished decoded = Process({"ffmpeg", "-v", "error", "-i", film + ".mkv", "-fps_mode", "passthrough", "-f",
                                        "rawvideo", "-pix_fmt", "gray", film + ".raw"})
                                   .wait();
      EXPECT_EQ(decoded.code, 0) << decoded.err;
      pictures.push_back(content(film + ".raw"));
      EXPECT_EQ(pictures.back().size(), sets.size() * kBytes);
    }
    for (const auto& row : table(kPlace + "/export/frames.csv")) {
      const auto set = std::stoul(row.at("index")), head = std::stoul(row.at("head"));
      Evidence& to = all[head];
      if (!row.at("placeholder").empty()) {
        to.missing.push_back(set);
        continue;
      }
      const std::int64_t counter = std::stoll(row.at("sequence"));
      const std::int64_t offset = counter - std::stoll(sets[set].at("pulse"));
      if (to.offsets.empty() || to.offsets.back() != offset) to.offsets.push_back(offset);
      const auto last = static_cast<std::uint8_t>(pictures[head].at((set + 1) * kBytes - 1));
      if (last != static_cast<std::uint8_t>(counter)) ++to.wrong_pictures;
    }
    return all;
  }

  const SimChip chip_{"rig", 4};
  const CableGadget vivid_cable_{"VIVID", 0}, iidc_cable_{"IIDC", 1};
  std::array<std::unique_ptr<IidcCamera>, kCameras> cameras_;
};

TEST_F(WholeRig, ThirtySeconds_EachFrameBelongsToItsPulseAndEveryGapHasAReason) {
  Rig vivid("vivid", vivid_cable_, vivid_toml(vivid_cable_.folder()));
  Rig iidc("iidc", iidc_cable_, iidc_toml(iidc_cable_.folder(), chip_.name(), cameras_));
  std::ofstream(kPlace + "/fisheyes.json") << fisheyes();
  vivid.ask({"--timeout", "2min", "calibration", "upload", NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"},
            vivid.cable());
  iidc.ask({"--timeout", "2min", "calibration", "upload", kPlace + "/fisheyes.json"}, iidc.cable());
  ASSERT_TRUE(test::wait_until([&] {
    return std::all_of(cameras_.begin(), cameras_.end(), [](const auto& each) { return each->transmits(); }) &&
           number(vivid.status(), "full_sets") > 30;
  })) << vivid.status();
  EXPECT_EQ(number(iidc.status(), "frames_taken"), 0) << "there was no pulse";
  iidc.ask({"genlock", "start"});
  ASSERT_TRUE(test::wait_until([&] { return number(iidc.status(), "full_sets") > 10; })) << iidc.status();
  iidc.ask({"take", "start"});

  const auto vivid_host = vivid.puller(), iidc_host = iidc.puller();
  const auto pass = [&](int seconds) { wait_for_both(*vivid_host, *iidc_host, Duration::seconds(seconds)); };
  pass(5);
  cameras_[0]->skip_a_frame();
  pass(4);
  cameras_[1]->tear_a_frame();
  pass(4);
  cameras_[2]->send_no_frames(true);
  pass(1);
  cameras_[2]->send_no_frames(false);
  pass(4);
  cameras_[3]->unplug();
  pass(1);
  plug(3);
  pass(11);
  const Finished vivid_pulled = vivid_host->wait(), iidc_pulled = iidc_host->wait();
  const Json vivid_status = vivid.status(), vivid_heads = vivid.heads();
  iidc.ask({"take", "stop"});
  ASSERT_TRUE(test::wait_until([&] { return std::filesystem::exists(kPlace + "/takes/000001/manifest"); }));
  const Json iidc_status = iidc.status(), iidc_heads = iidc.heads();
  std::ofstream("vivid.json") << vivid_status << "\n" << vivid_heads << "\n" << vivid_pulled.out;
  std::ofstream("iidc.json") << iidc_status << "\n" << iidc_heads << "\n" << iidc_pulled.out;
  vivid.end();
  iidc.end();
  const Finished exported =
      Process({NODAL_BIN_DIR "/nodal", "take", "export", kPlace + "/takes/000001", "--to", kPlace + "/export"}).wait();
  ASSERT_EQ(exported.code, 0) << exported.err;
  const auto sets = table(kPlace + "/export/sets.csv");
  const std::vector<Evidence> cameras = evidence(sets);

  // Ten heads that run free: a raymap of each field, from every head, and nothing is lost.
  expect_conserved(vivid_status);
  EXPECT_EQ(vivid_status["losses"], Json::object());
  for (const Json& head : vivid_heads) EXPECT_EQ(head["trigger"], "free") << head;
  const std::vector<Json> fields = received(vivid_pulled, 2 * kNtsc);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    EXPECT_EQ(fields[i]["heads"].size(), static_cast<std::size_t>(kVividHeads)) << fields[i];
    EXPECT_EQ(fields[i]["parity"], number(fields[i], "field") == 0 ? "bottom" : "top") << fields[i];
    if (i == 0) continue;
    EXPECT_EQ(2 * number(fields[i], "set") + number(fields[i], "field"),
              2 * number(fields[i - 1], "set") + number(fields[i - 1], "field") + 1)
        << fields[i];
  }

  // Four heads that pulses expose: every pulse has a set, and every frame is in the set of the pulse that its camera
  // counted.
  expect_conserved(iidc_status);
  EXPECT_EQ(iidc_status["losses"], (Json{{"corrupt", 1}})) << "the torn frame's remainder";
  EXPECT_EQ(iidc_status["genlock"]["pulse_losses"], Json::object());
  std::map<std::int64_t, std::vector<int>> heads_of;  // by pulse
  for (std::size_t k = 0; k < sets.size(); ++k) {
    const std::int64_t pulse = std::stoll(sets[k].at("pulse"));
    EXPECT_EQ(pulse, std::stoll(sets[0].at("pulse")) + static_cast<std::int64_t>(k));
    for (int i = 0; i < kCameras; ++i) {
      const auto& missing = cameras[static_cast<std::size_t>(i)].missing;
      if (!std::binary_search(missing.begin(), missing.end(), k)) heads_of[pulse].push_back(i);
    }
  }
  for (const Json& raymap : received(iidc_pulled, kPulseRate)) {
    EXPECT_EQ(raymap["heads"].get<std::vector<int>>(), heads_of[number(raymap, "trigger")]) << raymap;
  }
  // Pulse 0 is the first that the cameras count. Camera 1's torn frame and the next one make one picture, which looks
  // good and comes with the next pulse; cameras that are plugged in again count anew.
  using Offsets = std::vector<std::int64_t>;
  EXPECT_EQ(cameras[0].offsets, Offsets{1});
  EXPECT_EQ(cameras[1].offsets, (Offsets{1, 0, 1}));
  EXPECT_EQ(cameras[2].offsets, Offsets{1});
  ASSERT_EQ(cameras[3].offsets.size(), 2u);
  EXPECT_EQ(cameras[3].offsets[0], 1);
  // Exactly the faults are missing: a frame; a torn one, the corrupt one and what the restart took; 1 s; unplugged for
  // 1 s and opened.
  EXPECT_EQ(cameras[0].missing.size(), 1u);
  EXPECT_NEAR(static_cast<double>(cameras[1].missing.size()), 4, 2);
  EXPECT_NEAR(static_cast<double>(cameras[2].missing.size()), kPulseRate, 1);
  EXPECT_NEAR(static_cast<double>(cameras[3].missing.size()), 2 * kPulseRate, kPulseRate);
  for (std::size_t i = 0; i < kCameras; ++i) {
    EXPECT_EQ(cameras[i].wrong_pictures, i == 1 ? 1u : 0u) << i;
    EXPECT_TRUE(i == 1 || cameras[i].missing_in_one_piece()) << i;
    // Before the take, the first pulse may come while the heads are still being started.
    EXPECT_LE(number(iidc_heads[i], "missing_sets") - static_cast<std::int64_t>(cameras[i].missing.size()), 1) << i;
    EXPECT_EQ(iidc_heads[i]["trigger"], "input");
    EXPECT_EQ(number(iidc_heads[i], "opened"), i == 3 ? 2 : 1);
    EXPECT_EQ(number(iidc_heads[i], "exposure_ns"), 1000 * (i == kByPulse ? kPulseUs : kShutterUs));
  }
  EXPECT_NE(iidc_heads[1]["problem"].get<std::string>().find("started again, 1 times"), std::string::npos);
}

}  // namespace
}  // namespace nodal::hil
