// `nodal render` with a film for players: the raymaps of a take, whatever the work is cut into.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class TakeFilm : public RigTest {
 protected:
  void SetUp() override {
    if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  }
  void with(const std::string& before, const std::string& more) {
    std::string toml = read("rig.toml");
    const std::size_t at = toml.find(before);
    ASSERT_NE(at, std::string::npos) << before;
    write("rig.toml", toml.insert(at + before.size(), more));
  }
  /// Records a take of at least so many sets.
  void record(std::uint64_t sets) {
    with("folder = \"store\"\n", "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n");
    with("[sim]\n", "noise = 2\n");
    start_nodald();
    bring_up();
    ASSERT_EQ(nodal({"take", "start"}).code, 0);
    ASSERT_TRUE(test::wait_until([&] {
      const Json recording = nodal_json({"status"}).at(0)["recording"];
      return recording["sets"].get<std::uint64_t>() >= sets;
    }));
    ASSERT_EQ(nodal({"take", "stop"}).code, 0);
    nodald().signal(SIGTERM);
    nodald().wait();
  }
  Words render(const std::string& out, const Words& more = {}) const {
    Words words{"render", path("takes/000001"), "-o", path(out)};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  void expect_good(const Words& words) const {
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
  }
  void expect_no_film(const Words& words, const std::string& says, const std::string& out) const {
    const Finished run = nodal(words);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(path(out))) << says;
  }
  std::string probed(const std::string& what, const std::string& film) const {
    return Process({"ffprobe", "-v", "error", "-show_entries", what, "-of", "default=nw=1", path(film)}).wait().out;
  }
  std::string pixels(const std::string& film) const {
    return Process({"ffmpeg", "-v", "error", "-i", path(film), "-map", "0:v", "-fps_mode", "passthrough", "-f",
                    "rawvideo", "-pix_fmt", "yuv420p", "-"})
        .wait()
        .out;
  }
  struct Raymap {
    double at_s = 0;
    std::string bytes;
  };
  /// What `nodal render` makes of the take as files.
  std::vector<Raymap> raymaps(Words more = {}) const {
    Words words = render("r-%05d.raw", more);
    std::vector<Raymap> all;
    for (const Json& line : nodal_json(words)) {
      if (!line.contains("raymap")) continue;
      const std::string file = line["raymap"]["file"];
      all.push_back({1e-9 * line["raymap"]["mid_exposure_ns"].get<double>(), read(fs::path(file).filename().string())});
    }
    return all;
  }
  /// The frames of a film at this rate: the nearest raymap to each instant.
  static std::string shown(const std::vector<Raymap>& all, double hertz) {
    std::string frames;
    const double length = all.back().at_s - all.front().at_s;
    for (int k = 0; k <= static_cast<int>(length * hertz + 1e-3); ++k) {
      const double at = all.front().at_s + k / hertz;
      const auto nearest =
          std::ranges::min_element(all, {}, [&](const Raymap& one) { return std::abs(one.at_s - at); });
      frames += nearest->bytes;
    }
    return frames;
  }
};

TEST_F(TakeFilm, Lossless_FramesAreTheRaymapsOfTheTake) {
  record(20);
  expect_good(render("film.mkv", {"--codec", "ffv1"}));
  EXPECT_FALSE(fs::exists(path("film.mkv.parts")));
  const std::vector<Raymap> all = raymaps();
  ASSERT_GE(all.size(), 20U);
  EXPECT_TRUE(pixels("film.mkv") == shown(all, 25));

  const Json said = nodal_json(render("sphere.mp4", {"--from", "0.2s", "--to", "0.6s"})).back();
  EXPECT_EQ(said["codec"], "h264");
  EXPECT_EQ(said["rate"], 25);
  EXPECT_EQ(said["take"], 1);
  EXPECT_NEAR(said["frames"].get<double>(), 10, 1);
  EXPECT_LT(said["farthest_ms"], 21) << "half a period, if no set is missing";
  const std::string side = Process({"ffprobe", "-v", "error", "-show_streams", path("sphere.mp4")}).wait().out;
  EXPECT_NE(side.find("projection=equirectangular"), std::string::npos) << side;
  EXPECT_NE(side.find("r_frame_rate=25/1"), std::string::npos) << side;

  const Json small = nodal_json(render("p.mkv", {"--preview", "--codec", "ffv1", "--width", "64"})).back();
  EXPECT_EQ(small["width"], 64);
  EXPECT_LE(small["frames"], 48);
  expect_no_film(render("s.mp4", {"--segments", "1"}), "the film has the segments 0 to 0", "s.mp4");
  expect_no_film(render("u.mp4", {"--from", "100s", "--to", "101s"}), "no set between --from and --to", "u.mp4");
  expect_no_film(render("t.mp4", {"--codec", "ffv1"}), "let --out end in .mkv", "t.mp4");
  expect_no_film(render("t-%03d.jpg", {"--codec", "h264"}), "are for films", "t-001.jpg");
  expect_no_film(render("t.mp4", {"--join"}), "there is no plan; make the segments first", "t.mp4");
}

/// Fields and exposures of heads change from raymap to raymap, and seams are placed where the take has none: segments
/// that are made in another order still have the same bytes.
TEST_F(TakeFilm, OneProcessShardsAndATruncatedSegment_SameBytes) {
  with("[raymap]\n", "fields = \"separate\"\nseams = \"placed\"\n");
  with("rate = \"25\"\n", "[exposure]\nprogram = \"each\"\nramp_stops = 0.05\n");
  for (int i = 0; i < 6; ++i) {
    const std::string name = "name = \"cam" + std::to_string(i) + "\"\n";
    with(name, "fields = \"bottom-first\"\nformat = \"YUYV\"\nexposure_us = " + std::to_string(200 << i) + "\n");
  }
  record(130);  // 260 raymaps: two segments
  const std::vector<Raymap> all = raymaps();
  ASSERT_GE(all.size(), 260U);
  expect_good(render("later.mkv", {"--codec", "ffv1", "--from", "0.01s"}));
  EXPECT_TRUE(pixels("later.mkv") == shown({all.begin() + 1, all.end()}, 50)) << "from the second field of a set on";
  for (const bool other : {false, true}) {
    SCOPED_TRACE(other ? "another calibration, whose seams are placed" : "the take's calibration and seams");
    Words how{"--codec", "ffv1"};
    if (other) how.insert(how.end(), {"--calibration", path("truth.json")});
    const auto with_words = [&](const Words& more) {
      Words words = how;
      words.insert(words.end(), more.begin(), more.end());
      return words;
    };
    const std::string name = other ? "other" : "own";
    expect_good(render(name + "1.mkv", how));
    const std::string one = read(name + "1.mkv");
    if (!other) {
      EXPECT_TRUE(pixels("own1.mkv") == shown(all, 50));
    }
    for (const char* const shard : {"1", "0"}) expect_good(render(name + "2.mkv", with_words({"--segments", shard})));
    for (const auto& entry : fs::directory_iterator(path(name + "2.mkv.parts"))) {
      const std::string file = entry.path().filename().string();
      if (file.starts_with("seg-00001") && file.ends_with(".mov")) fs::resize_file(entry.path(), 1000);
    }
    expect_no_film(render(name + "2.mkv", with_words({"--join"})), "segments are missing or damaged: 1",
                   name + "2.mkv");
    expect_good(render(name + "2.mkv", how));
    EXPECT_TRUE(read(name + "2.mkv") == one);
  }
  expect_good(render("x.mkv", {"--codec", "ffv1", "--plan"}));
  expect_no_film(render("x.mkv", {"--codec", "ffv1", "--width", "128"}), "other settings (width", "x.mkv");
}

}  // namespace
}  // namespace nodal::command_line
