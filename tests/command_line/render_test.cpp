// Takes that the real nodald recorded, afterwards: `nodal render` beside the raymaps that it made while it filmed,
// `nodal take show` and `take export`, and heads that play a take.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <map>
#include <utility>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

class RenderTest : public RigTest {
 protected:
  /// A raymap of a set, or of one of its fields.
  using Name = std::pair<std::uint64_t, int>;
  using Raymaps = std::map<Name, std::string>;

  /// Changes rig.toml before the start.
  void with(const std::string& from, const std::string& to) { write("rig.toml", replaced(read("rig.toml"), from, to)); }
  void head_key(const std::string& line) {
    for (int i = 0; i < 6; ++i) {
      const std::string name = "name = \"cam" + std::to_string(i) + "\"\n";
      with(name, name + line + "\n");
    }
  }
  void start_take(const std::string& takes = "") {
    with("[sim]\n", "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\n" + takes + "[sim]\nnoise = 2\n");
    start_nodald();
    bring_up();
    EXPECT_EQ(nodal({"take", "start"}).code, 0);
  }
  /// Films and records, pulls `count` raymaps meanwhile, and returns them.
  Raymaps film(int count, const std::string& takes = "") {
    start_take(takes);
    const std::vector<Json> said =
        nodal_json({"raymap", "pull", "-n", std::to_string(count), "--lossless", "--out", path("live-%04d.raw")});
    EXPECT_EQ(nodal({"take", "mark", "the bus, \"42\""}).code, 0);
    const Finished stopped = nodal({"take", "stop"});
    EXPECT_EQ(stopped.code, 0) << stopped.err;
    return raymaps_of(said);
  }
  Raymaps raymaps_of(const std::vector<Json>& said) const {
    Raymaps raymaps;
    for (const Json& line : said) {
      if (!line.contains("raymap")) continue;
      const Json& raymap = line["raymap"];
      const std::string file = raymap["file"];
      raymaps[{raymap["set"].get<std::uint64_t>(), raymap.value("field", 0)}] =
          read(fs::path(file).filename().string());
    }
    return raymaps;
  }
  std::string take() const { return path("takes/000001"); }
  Raymaps rendered(Words more = {}) const {
    Words words{"render", take(), "-o", path("later-%04d.raw")};
    words.insert(words.end(), more.begin(), more.end());
    return raymaps_of(nodal_json(words));
  }
  /// Records a take, plays it as heads, and expects only raymaps that were rendered from it.
  void expect_heads_that_play_it_give_its_raymaps(const std::string& takes = "") {
    with("[links]", "[exposure]\nprogram = \"each\"\nramp_stops = 0.05\n[links]");
    head_key("exposure_us = 300");
    film(20, takes);
    const Raymaps first = rendered();
    std::string toml = read("rig.toml");
    toml = replaced(toml, "[exposure]\nprogram = \"each\"\nramp_stops = 0.05\n", "");
    toml = replaced(toml, "[takes]\nfolder = \"takes\"", "[takes]\nfolder = \"second\"");
    toml = replaced(toml, "[sim]\nnoise = 2\ncalibration = \"truth.json\"\n", "");
    for (int i = 0; i < 6; ++i) {
      const std::string name = "cam" + std::to_string(i);
      toml = replaced(toml, "exposure_us = 300\nport = \"sim:" + name, "port = \"take:takes/000001/" + name);
    }
    write("rig.toml", toml);
    fs::remove_all(path("store"));
    start_nodald();
    bring_up();
    const Raymaps again =
        raymaps_of(nodal_json({"raymap", "pull", "-n", "12", "--lossless", "--out", path("again-%04d.raw")}));
    ASSERT_EQ(again.size(), 12U);
    for (const auto& [name, bytes] : again) {
      const bool known = std::any_of(first.begin(), first.end(), [&](const auto& one) { return one.second == bytes; });
      EXPECT_TRUE(known) << "set " << name.first;
    }
  }
  /// Every live raymap but those from before the take is rendered with the same bytes.
  void expect_same(const Raymaps& live, const Raymaps& later) const {
    ASSERT_FALSE(later.empty());
    std::size_t compared = 0;
    for (const auto& [name, bytes] : live) {
      if (name < later.begin()->first) continue;
      const auto found = later.find(name);
      ASSERT_NE(found, later.end()) << "set " << name.first << ", field " << name.second;
      EXPECT_EQ(found->second == bytes, true) << "set " << name.first << ", field " << name.second;
      ++compared;
    }
    EXPECT_GE(compared, live.size() - 3);
  }
};

TEST_F(RenderTest, RawTakes_GiveTheBytesThatTheRigMade) {
  const Raymaps live = film(20);
  const Raymaps later = rendered();
  EXPECT_GE(later.size(), 20U);
  expect_same(live, later);
  EXPECT_EQ(rendered({"--threads", "1"}), later);
  // The pictures differ from set to set, so equal bytes cannot be an accident.
  EXPECT_NE(later.begin()->second, std::next(later.begin())->second);
}

/// Two swaps while it films: each set is rendered with the calibration that the rig used, also if nodald was killed.
TEST_F(RenderTest, CalibrationsSwappedInATake_AreEachUsedForTheirSets) {
  Calibration other = six_heads("other");
  for (HeadCalibration& head : other.heads) head.center_x += 3;
  write("other.json", to_json(other));
  for (const bool killed : {false, true}) {
    SCOPED_TRACE(killed ? "nodald killed" : "take stopped");
    if (killed) {
      fs::remove_all(path("takes"));
      start_nodald();
      bring_up();
      ASSERT_EQ(nodal({"take", "start"}).code, 0);
    } else {
      start_take();
    }
    Raymaps live;
    const auto pull = [&](const std::string& name) {
      live.merge(raymaps_of(nodal_json({"raymap", "pull", "-n", "8", "--lossless", "--out", path(name)})));
    };
    pull("one-%04d.raw");
    ASSERT_EQ(nodal({"calibration", "upload", path("other.json")}).code, 0);
    pull("two-%04d.raw");
    ASSERT_EQ(nodal({"calibration", "rollback"}).code, 0);
    pull("three-%04d.raw");
    if (killed) {
      wait_until_durable();
      nodald().signal(SIGKILL);
      nodald().wait();
      start_nodald();
      ASSERT_TRUE(wait_until([&] { return fs::exists(take() + "/manifest"); }));
    } else {
      ASSERT_EQ(nodal({"take", "stop"}).code, 0);
    }
    const Raymaps later = rendered();
    expect_same(live, later);
    const Json shown = nodal_json({"take", "show", take()}).at(0);
    ASSERT_EQ(shown["later_calibrations"].size(), 2U);
    EXPECT_EQ(shown["later_calibrations"][1]["id"], shown["calibration"]) << "rolled back";
    EXPECT_EQ(nodal({"take", "verify", take()}).code, 0);
    EXPECT_NE(rendered({"--calibration", path("other.json")}), later);
  }
}

TEST_F(RenderTest, LosslessTakes_GiveTheBytesThatTheRigMade) {
  head_key("fields = \"bottom-first\"\nformat = \"YUYV\"");
  const Raymaps live = film(20, "mode = \"lossless\"\n");
  expect_same(live, rendered());
  if (Process({"sh", "-c", "command -v ffprobe"}).wait().code != 0) GTEST_SKIP() << "ffprobe is not installed";
  const Finished probed = Process({"ffprobe", "-v", "error", "-show_entries", "stream=codec_name,field_order", "-of",
                                   "csv=p=0", take() + "/cam0-0000.mkv"})
                              .wait();
  EXPECT_NE(probed.out.find("utvideo,bt"), std::string::npos) << probed.out;
  ASSERT_EQ(nodal({"take", "export", take(), "--to", path("out")}).code, 0);
  const auto decoded = [&](const std::string& film) {
    return Process({"ffmpeg", "-v", "error", "-i", film, "-map", "0:v", "-fps_mode", "passthrough", "-f", "rawvideo",
                    "-pix_fmt", "yuv422p", "-"})
        .wait()
        .out;
  };
  const std::string exported = decoded(path("out/cam0.mkv"));
  EXPECT_FALSE(exported.empty());
  EXPECT_EQ(exported == decoded(take() + "/cam0-0000.mkv"), true);
}

TEST_F(RenderTest, HeadsStoredInModesOfTheirOwn_GiveTheBytesThatTheRigMade) {
  head_key("format = \"MJPEG\"");
  with("name = \"cam0\"\n", "name = \"cam0\"\ntake_mode = \"driver\"\n");
  const Raymaps live = film(20, "mode = \"raw\"\n");
  expect_same(live, rendered());
  const Json shown = nodal_json({"take", "show", take()}).at(0);
  EXPECT_EQ(shown["mode"], "driver, raw");
  if (Process({"sh", "-c", "command -v ffprobe"}).wait().code != 0) GTEST_SKIP() << "ffprobe is not installed";
  for (const auto& [head, codec] : {std::pair{"cam0", "mjpeg"}, std::pair{"cam1", "rawvideo"}}) {
    const Finished probed = Process({"ffprobe", "-v", "error", "-show_entries", "stream=codec_name", "-of", "csv=p=0",
                                     take() + "/" + head + "-0000.mkv"})
                                .wait();
    EXPECT_NE(probed.out.find(codec), std::string::npos) << head << ": " << probed.out;
  }
}

TEST_F(RenderTest, FieldsAndExposuresThatChangeFromSetToSet_AreThoseOfTheEvidence) {
  with("height = 128\n", "height = 128\nfields = \"separate\"\n");
  with("[links]", "[exposure]\nprogram = \"each\"\nramp_stops = 0.05\n[links]");
  head_key("fields = \"bottom-first\"\nformat = \"YUYV\"");
  // Only differences between heads change an 8-bit raymap.
  for (int i = 0; i < 6; ++i) {
    const std::string name = "name = \"cam" + std::to_string(i) + "\"\n";
    with(name, name + "exposure_us = " + std::to_string(200 << i) + "\n");
  }
  const Raymaps live = film(40);
  expect_same(live, rendered());
}

TEST_F(RenderTest, LinearLight_GivesTheSameNumbers) {
  with("height = 128\n", "height = 128\nformat = \"RGB48\"\n");
  with("[links]", "[exposure]\nprogram = \"joint\"\nramp_stops = 0.05\n[links]");
  head_key("format = \"RGB24\"\nexposure_us = 300");
  const Raymaps live = film(12);
  expect_same(live, rendered());
}

TEST_F(RenderTest, OfJpegs_AreNearlyTheRigsOwn) {
  with("height = 128\n", "height = 128\nfields = \"separate\"\n");
  head_key("fields = \"top-first\"\nformat = \"YUYV\"");
  const Raymaps live = film(12, "mode = \"jpeg\"\n");
  const Raymaps later = rendered();
  std::size_t compared = 0;
  for (const auto& [name, bytes] : live) {
    const auto found = later.find(name);
    if (found == later.end()) continue;
    ASSERT_EQ(found->second.size(), bytes.size());
    double sum = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const int d = static_cast<std::uint8_t>(bytes[i]) - static_cast<std::uint8_t>(found->second[i]);
      sum += d * d;
    }
    // JPEG of quality 90 keeps noisy pictures of heads within 35 dB; fields in the wrong order are 20 dB off here.
    EXPECT_LT(std::sqrt(sum / static_cast<double>(bytes.size())), 4.5) << name.first << " " << name.second;
    ++compared;
  }
  EXPECT_GE(compared, 9U);
}

TEST_F(RenderTest, PartsOtherLayoutsAndFilms) {
  film(30);
  const Raymaps all = rendered();
  const Raymaps part = rendered({"--from", "0.4s", "--to", "0.8s"});
  EXPECT_NEAR(static_cast<double>(part.size()), 10, 1) << "0.4 s at 25 sets a second";
  for (const auto& [name, bytes] : part) EXPECT_TRUE(all.at(name) == bytes) << name.first;
  EXPECT_NEAR(static_cast<double>(std::distance(all.begin(), all.find(part.begin()->first))), 10, 1);

  const Json cube =
      nodal_json({"render", take(), "-o", path("cube-%02d.png"), "--layout", "cube", "--width", "192", "--to", "0.1s"})
          .back()["summary"];
  EXPECT_EQ(cube["layout"], "cube");
  EXPECT_EQ(cube["raymaps"], 3);
  const std::string png = read("cube-03.png");
  ASSERT_GE(png.size(), 24U);
  EXPECT_EQ(png.substr(16, 8), std::string("\0\0\0\xC0\0\0\0\x80", 8)) << "192x128";

  const Json film = nodal_json({"render", take(), "-o", path("film.mkv")}).back()["summary"];
  EXPECT_EQ(film["raymaps"], all.size());
  EXPECT_EQ(film["incomplete"], 0);
  if (Process({"sh", "-c", "command -v ffprobe"}).wait().code != 0) return;
  const Finished probe = Process({"ffprobe", "-v", "error", "-count_packets", "-show_entries",
                                  "stream=codec_name,nb_read_packets", "-of", "default=nk=1:nw=1", path("film.mkv")})
                             .wait();
  EXPECT_EQ(probe.out, "mjpeg\n" + std::to_string(all.size()) + "\n");
}

TEST_F(RenderTest, ATakeAsHeads_GivesItsRaymapsAgain) {
  expect_heads_that_play_it_give_its_raymaps();
  const std::string toml = read("rig.toml");
  write("rig.toml", replaced(toml, "rate = \"25\"", "rate = \"24\""));
  const Finished check = Process({NODAL_BIN_DIR "/nodald", "--config", path("rig.toml"), "--check"}).wait();
  EXPECT_NE(check.code, 0);
  EXPECT_NE(check.err.find("write rate = \"25/1\""), std::string::npos) << check.err;
}

TEST_F(RenderTest, ALosslessTakeAsHeads_GivesItsRaymapsAgain) {
  expect_heads_that_play_it_give_its_raymaps("mode = \"lossless\"\n");
  EXPECT_NE(nodal({"take", "show", path("takes/000001")}).out.find("as Ut Video"), std::string::npos);
}

TEST_F(RenderTest, Shown_HasHeadsMarksAndNothingMissing) {
  film(10);
  const Finished text = nodal({"take", "show", take()});
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("96x96 I420"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("the bus, \"42\""), std::string::npos) << text.out;
  const Json document = nodal_json({"take", "show", take()}).at(0);
  EXPECT_GE(document["sets"], 10);
  EXPECT_FALSE(document.contains("seams")) << "they are fixed";
  ASSERT_EQ(document["heads"].size(), 6U);
  for (const Json& head : document["heads"]) {
    EXPECT_EQ(head["pictures"], document["sets"]) << head;
    EXPECT_TRUE(head["placeholders"].empty()) << head;
  }
  const std::int64_t at = document["marks"].at(0)["at_ns"];
  EXPECT_GE(at, 0);
  EXPECT_LE(at, document["length_ns"].get<std::int64_t>() + 40'000'000);
}

TEST_F(RenderTest, ByItsNumber_ATakeOnTheRigsDiskIsShownAndRenderedAsItsCopyIs) {
  film(10);
  EXPECT_EQ(nodal_json({"take", "show", "1"}), nodal_json({"take", "show", take()}));
  const Raymaps local = rendered();
  const Raymaps remote = raymaps_of(nodal_json({"render", "1", "-o", path("remote-%04d.raw")}));
  EXPECT_EQ(remote, local);
  const Finished none = nodal({"take", "show", "5"});
  EXPECT_NE(none.code, 0);
  EXPECT_NE(none.err.find("take 5"), std::string::npos) << none.err;

  const Json list = nodal_json({"take", "list", "--thumbnails", path("small")}).at(0)["takes"];
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0]["thumbnail"], path("small/000001.jpg"));
  EXPECT_EQ(read("small/000001.jpg"), read("takes/000001/thumb.jpg"));

  nodald().signal(SIGTERM);
  nodald().wait();
  const Finished away = nodal({"render", "1", "-o", path("x.mkv")});
  EXPECT_NE(away.err.find("there is no folder '1', and the rig"), std::string::npos) << away.err;
  EXPECT_EQ(nodal({"take", "show", take()}).code, 0);
}

TEST_F(RenderTest, Exported_FilmsHaveTheSamePicturesAndTablesARowForEachFrame) {
  film(10);
  const Json done = nodal_json({"take", "export", take(), "--to", path("out")}).at(0);
  EXPECT_EQ(done["films"], 7);
  const auto lines = [&](const std::string& name) {
    const std::string text = read(name);
    return std::count(text.begin(), text.end(), '\n');
  };
  const std::int64_t sets = done["sets"];
  EXPECT_EQ(lines("out/sets.csv"), 1 + sets);
  EXPECT_EQ(lines("out/frames.csv"), 1 + 6 * sets);
  EXPECT_EQ(read("out/sets.csv").find("index,number,mid_exposure_ns"), 0U);
  EXPECT_NE(nodal({"take", "export", take(), "--to", take()}).code, 0) << "into the take itself";
  const std::string exported = read("out/cam0.mkv");
  const Refusing overwriting;
  const Finished again = nodal({"take", "export", take(), "--to", path("out")});
  EXPECT_NE(again.code, 0) << "films are there already";
  EXPECT_NE(again.err.find("already; name another folder"), std::string::npos) << again.err;
  EXPECT_EQ(read("out/cam0.mkv") == exported, true);
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  const auto decoded = [&](const std::string& film) {
    return Process({"ffmpeg", "-v", "error", "-i", path(film), "-map", "0:v", "-fps_mode", "passthrough", "-f",
                    "framemd5", "-"})
        .wait()
        .out;
  };
  for (int i = 0; i < 6; ++i) {
    const std::string name = "cam" + std::to_string(i);
    const std::string before = decoded("takes/000001/" + name + "-0000.mkv");
    EXPECT_GT(before.size(), 100U);
    EXPECT_EQ(decoded("out/" + name + ".mkv"), before) << name;
  }
}

TEST_F(RenderTest, WhatCannotBeRendered_IsSaidOnceAndNothingIsWritten) {
  film(5);
  constexpr int kUsage = 2;
  const auto refused = [&](Words words, int code, const std::string& says) {
    words.insert(words.begin(), "render");
    const Finished done = nodal(words);
    EXPECT_EQ(done.code, code) << done.err;
    EXPECT_NE(done.err.find(says), std::string::npos) << done.err;
    const auto lines = std::count(done.err.begin(), done.err.end(), '\n');
    EXPECT_EQ(lines, code == kUsage ? 2 : 1) << done.err;  // a wrong word is followed by where the words are explained
  };
  const std::string out = path("no-%d.png");
  refused({path("nowhere"), "-o", out}, 6, "nowhere/take.json");
  refused({take(), "-o", path("all.png")}, kUsage, "put %06d into it");
  refused({take(), "-o", out, "--from", "90min"}, 6, "no set between --from and --to");
  refused({take(), "-o", out, "--from", "2s", "--to", "1s"}, kUsage, "the end must be behind the beginning");
  Calibration fewer = six_heads("fewer");
  fewer.heads.pop_back();
  write("fewer.json", to_json(fewer));
  refused({take(), "-o", out, "--calibration", path("fewer.json")}, 4, "cam5");

  const auto early = start({"render", take(), "-o", path("early.mkv")});
  early->signal(SIGINT);
  early->wait();
  EXPECT_TRUE(!fs::exists(path("early.mkv")) || fs::file_size(path("early.mkv")) > 0);

  std::string video = read("takes/000001/cam2-0000.mkv");
  // A byte of a picture that is not what was recorded.
  video[video.size() / 2] = static_cast<char>(video[video.size() / 2] ^ 1);
  write("takes/000001/cam2-0000.mkv", video);
  refused({take(), "-o", path("film.mkv")}, 4, "cam2-0000.mkv");
  fs::remove(take() + "/manifest");
  refused({take(), "-o", out}, 7, "was not ended");
  for (const auto& entry : fs::directory_iterator(path(""))) {
    EXPECT_NE(entry.path().filename().string().substr(0, 3), "no-");
  }
}

}  // namespace
}  // namespace nodal::command_line
