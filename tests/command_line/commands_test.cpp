// Every command of the real `nodal` against a real nodald, as a user types them.
#include <gtest/gtest.h>
#include <signal.h>
#include <turbojpeg.h>

#include <filesystem>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

using Commands = RigTest;

std::uint64_t sum_of(const Json& counts) {
  std::uint64_t sum = 0;
  for (const auto& [reason, count] : counts.items()) sum += count.get<std::uint64_t>();
  return sum;
}

TEST_F(Commands, RigWithoutACalibration_SaysSoAndGivesNoRaymaps) {
  start_nodald();
  ASSERT_TRUE(wait_until([this] { return nodal_json({"status"}).at(0)["state"] == "no-calibration"; }));
  const Finished status = nodal({"status"});
  EXPECT_NE(status.out.find("nodal calibration upload"), std::string::npos) << status.out;
  EXPECT_EQ(status.err, "");
  const Finished pull = nodal({"raymap", "pull", "--out", path("x.jpg")});
  EXPECT_EQ(pull.code, 7) << pull.err;
  EXPECT_FALSE(std::filesystem::exists(path("x.jpg")));
  EXPECT_NE(nodal({"calibration", "list"}).out.find("no calibration"), std::string::npos);
}

TEST_F(Commands, FromUploadToPicture_EverythingIsThere) {
  start_nodald();
  bring_up();
  const Json pulled = nodal_json({"raymap", "pull", "--complete", "--out", path("raymap.jpg")}).at(0)["raymap"];
  EXPECT_EQ(pulled["coding"], "jpeg");
  EXPECT_EQ(pulled["layout"], "equirectangular");
  EXPECT_EQ(pulled["heads"].size(), 6U);
  EXPECT_EQ(pulled["calibration_id"], to_hex(calibration_id(six_heads("six"))));

  const std::string jpeg = read("raymap.jpg");
  EXPECT_EQ(jpeg.size(), pulled["bytes"]);
  int width = 0, height = 0, sampling = 0, colours = 0;
  tjhandle decoder = tjInitDecompress();
  EXPECT_EQ(tjDecompressHeader3(decoder, reinterpret_cast<const unsigned char*>(jpeg.data()), jpeg.size(), &width,
                                &height, &sampling, &colours),
            0);
  tjDestroy(decoder);
  EXPECT_EQ(width, 256);
  EXPECT_EQ(height, 128);
  EXPECT_NE(jpeg.find("GPano:ProjectionType=\"equirectangular\""), std::string::npos);

  const Json status = nodal_json({"status"}).at(0);
  EXPECT_EQ(status["frames_taken"], status["frames_in_sets"].get<std::uint64_t>() +
                                        status["frames_held"].get<std::uint64_t>() + sum_of(status["losses"]));
  EXPECT_EQ(status["rig"], "six");
  EXPECT_EQ(status["calibration_name"], "six");
  EXPECT_GE(status["raymaps"], 1);
}

TEST_F(Commands, PngAndRaw_HoldTheSameSphereAsEachOtherSays) {
  start_nodald();
  bring_up();
  EXPECT_EQ(nodal({"raymap", "pull", "--out", path("r.png")}).code, 0);
  EXPECT_EQ(read("r.png").substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(nodal({"raymap", "pull", "--out", path("r.raw")}).code, 0);
  EXPECT_EQ(read("r.raw").size(), 256U * 128 * 3 / 2);
  const Json sidecar = Json::parse(read("r.raw.json"));
  EXPECT_EQ(sidecar["coding"], "I420");
  EXPECT_EQ(sidecar["planes"][2]["offset"], 256 * 128 * 5 / 4);
}

/// rig.toml with heads and raymap in these formats.
std::string in_formats(std::string rig, const std::string& heads, const std::string& raymap) {
  std::string out;
  for (std::size_t at = 0; at < rig.size();) {
    const std::size_t end = std::min(rig.find('\n', at), rig.size());
    const std::string line = rig.substr(at, end - at);
    if (!line.starts_with("format")) out += line + "\n";
    if (line == "[raymap]") out += "format = \"" + raymap + "\"\n";
    if (line == "[[heads]]") out += "format = \"" + heads + "\"\n";
    at = end + 1;
  }
  return out;
}

TEST_F(Commands, LinearRaymap_IsPulledInSixteenBitsAndAsAJpeg) {
  write("rig.toml", in_formats(read("rig.toml"), "RGB24", "RGB48"));
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"head", "set", "cam1", "--exposure", "2ms"}).code, 0);
  ASSERT_EQ(nodal({"head", "set", "cam0", "--exposure", "8ms"}).code, 0);
  const auto pulled = [&](const std::string& name) {
    return nodal_json({"raymap", "pull", "--complete", "--out", path(name)}).at(0)["raymap"];
  };
  ASSERT_TRUE(wait_until([&] { return pulled("r.raw")["exposure_ns"][1] == 2'000'000; }));
  const Json raymap = pulled("r.raw");
  EXPECT_EQ(raymap["coding"], "RGB48");
  // Without vignetting the numbers reach the maximum of the head with the shortest exposure.
  EXPECT_NEAR(raymap["full_exposure_ns"].get<double>(), 2'000'000, 4'000);
  const std::string raw = read("r.raw");
  ASSERT_EQ(raw.size(), 256U * 128 * 6);
  EXPECT_EQ(Json::parse(read("r.raw.json"))["numbers"], "linear");
  EXPECT_EQ(pulled("r.png")["coding"], "RGB48");
  EXPECT_EQ(read("r.png").substr(24, 2), std::string("\x10\x02", 2)) << "16 bits of red, green, blue";
  EXPECT_EQ(pulled("r.jpg")["coding"], "jpeg");
  EXPECT_EQ(read("r.jpg").substr(0, 3), "\xff\xd8\xff");
}

TEST_F(Commands, GreyRaymap_IsPulledAsRawPngAndJpeg) {
  write("rig.toml", in_formats(read("rig.toml"), "GREY", "GREY"));
  start_nodald();
  bring_up();
  for (const char* name : {"r.raw", "r.png", "r.jpg"})
    ASSERT_EQ(nodal({"raymap", "pull", "--out", path(name)}).code, 0);
  EXPECT_EQ(read("r.raw").size(), 256U * 128);
  EXPECT_EQ(read("r.png").substr(24, 2), std::string("\x08\x00", 2)) << "8 bits of grey";
  EXPECT_EQ(read("r.jpg").substr(0, 3), "\xff\xd8\xff");
}

TEST_F(Commands, Nv12Raymap_IsPulledAsRawPngAndJpeg) {
  write("rig.toml", in_formats(read("rig.toml"), "YUYV", "NV12"));
  start_nodald();
  bring_up();
  for (const char* name : {"r.raw", "r.png", "r.jpg"})
    ASSERT_EQ(nodal({"raymap", "pull", "--out", path(name)}).code, 0);
  EXPECT_EQ(read("r.raw").size(), 256U * 128 * 3 / 2);
  const Json planes = Json::parse(read("r.raw.json"))["planes"];
  EXPECT_EQ(planes[2]["offset"], 256 * 128 + 1);
  EXPECT_EQ(planes[2]["pixel_stride"], 2);
  EXPECT_EQ(read("r.png").substr(24, 2), std::string("\x08\x02", 2));
  EXPECT_EQ(read("r.jpg").substr(0, 3), "\xff\xd8\xff");
}

TEST_F(Commands, ManyRaymaps_AreNumberedAndRise) {
  start_nodald();
  bring_up();
  const std::vector<Json> documents =
      nodal_json({"raymap", "pull", "-n", "5", "--lossless", "--out", path("r-%03d.jpg")});
  ASSERT_EQ(documents.size(), 6U);
  std::uint64_t before = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    const Json& raymap = documents[i]["raymap"];
    EXPECT_EQ(raymap["file"], path("r-00" + std::to_string(i + 1) + ".jpg"));
    EXPECT_TRUE(std::filesystem::exists(raymap["file"].get<std::string>()));
    EXPECT_GT(raymap["set"], before);
    before = raymap["set"];
  }
  EXPECT_EQ(documents[5]["summary"]["pulled"], 5);
  EXPECT_EQ(documents[5]["summary"]["dropped"], 0);
}

TEST_F(Commands, HeadSettings_TakeEffectOnExactlyThoseHeads) {
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"head", "set", "all", "--exposure", "1/250"}).code, 0);
  ASSERT_EQ(nodal({"head", "set", "cam1", "4", "--exposure", "2ms", "--gain", "3dB", "--wb", "1.5,1.25"}).code, 0);
  const bool done = wait_until([this] {
    const Json heads = nodal_json({"heads"}).at(0)["heads"];
    bool all = heads.size() == 6;
    for (std::size_t i = 0; i < heads.size(); ++i) {
      const bool set = i == 1 || i == 4;
      all = all && heads[i]["exposure_ns"] == (set ? 2'000'000 : 4'000'000) &&
            heads[i]["gain_mdb"] == (set ? 3000 : 0) && heads[i]["red_q12"] == (set ? 6144 : 4096) &&
            heads[i]["blue_q12"] == (set ? 5120 : 4096);
    }
    return all;
  });
  EXPECT_TRUE(done) << nodal({"heads"}).out;
}

TEST_F(Commands, GenlockStopAndAnotherRate_AreSeen) {
  start_nodald();
  bring_up();
  EXPECT_EQ(nodal_json({"genlock", "stop"}).at(0)["state"], "off");
  const Json started = nodal_json({"genlock", "start", "--rate", "20", "--pulse", "200us"}).at(0);
  EXPECT_EQ(started["rate"]["numerator"], 20);
  EXPECT_EQ(started["rate"]["denominator"], 1);
  EXPECT_TRUE(wait_until([this] { return nodal_json({"genlock", "show"}).at(0)["state"] == "locked"; }));
}

TEST_F(Commands, AButtonInRigToml_StartsMarksAndStopsWithoutAHost) {
  // One press, one while it runs, and one long press.
  write("rig.toml",
        "[panel]\nbutton = \"sim:1+0.2,3+0.2,4+1.8\"\nstatus = \"sim:\"\ntally = \"sim:\"\n" + read("rig.toml"));
  start_nodald();
  EXPECT_TRUE(wait_until([&] {
    nodald().complained();  // it logs every new host
    const Json status = nodal_json({"status"}).at(0);
    return status["marks"].size() == 1 && nodal_json({"genlock", "show"}).at(0)["state"] == "off";
  }));
  nodald().signal(SIGTERM);
  const Finished finished = nodald().wait();
  EXPECT_EQ(finished.code, 0);
  for (const char* said : {"the button starts the genlock", "marked set ", "the button stops the genlock"}) {
    EXPECT_NE(finished.err.find(said), std::string::npos) << finished.err;
  }
}

TEST_F(Commands, SecondCalibration_CanBeListedShownLeftAndComeBackTo) {
  start_nodald();
  bring_up();
  write("other.json", to_json(six_heads("other")));
  const std::string six = to_hex(calibration_id(six_heads("six")));
  const std::string other = nodal_json({"calibration", "upload", path("other.json")}).at(0)["id"];
  EXPECT_EQ(other, to_hex(calibration_id(six_heads("other"))));

  const auto in_force = [this] {
    std::string id;
    const Json list = nodal_json({"calibration", "list"}).at(0);
    for (const Json& entry : list["calibrations"]) {
      if (entry["in_force"].get<bool>()) id += entry["id"].get<std::string>();
    }
    return id;
  };
  EXPECT_EQ(in_force(), other);
  EXPECT_EQ(nodal({"calibration", "rollback"}).code, 0);
  EXPECT_EQ(in_force(), six);
  EXPECT_EQ(nodal({"calibration", "use", other.substr(0, 10)}).code, 0);
  EXPECT_EQ(in_force(), other);

  EXPECT_EQ(nodal_json({"calibration", "show"}).at(0)["name"], "other");
  EXPECT_EQ(nodal({"calibration", "show", six.substr(0, 8), "--out", path("copy.json")}).code, 0);
  EXPECT_EQ(*parse_calibration(read("copy.json")), six_heads("six"));
}

TEST_F(Commands, NodaldStartedAgain_HasTheCalibrationThatWasInForce) {
  start_nodald();
  bring_up();
  nodald().signal(SIGTERM);
  EXPECT_EQ(nodald().wait().code, 0);
  start_nodald();
  const std::string six = to_hex(calibration_id(six_heads("six")));
  EXPECT_TRUE(wait_until([&] { return nodal_json({"status"}).at(0)["calibration_id"] == six; }));
}

TEST_F(Commands, PullWhileTheStoredCalibrationIsCompiled_WaitsAndSaysSo) {
  start_nodald();
  bring_up();
  nodald().signal(SIGTERM);
  EXPECT_EQ(nodald().wait().code, 0);
  std::string toml = read("rig.toml");  // a raymap whose table takes a while
  toml.replace(toml.find("width = 256"), 11, "width = 4096");
  toml.replace(toml.find("height = 128"), 12, "height = 2048");
  write("rig.toml", toml);
  start_nodald();
  const auto compiles = [&] {
    return nodal_json({"status"}).at(0)["activity"].get<std::string>().find("compiling") != std::string::npos;
  };
  ASSERT_TRUE(wait_until(compiles));  // the pull asks once a second: what comes before may be all that it sees
  const auto pull = start({"raymap", "pull", "--out", path("r.jpg")});
  ASSERT_EQ(nodal({"genlock", "start"}).code, 0);
  const Finished pulled = pull->wait();
  EXPECT_EQ(pulled.code, 0) << pulled.err;
  EXPECT_NE(pulled.err.find("compiling the table"), std::string::npos) << pulled.err;
  EXPECT_EQ(read("r.jpg").substr(0, 2), "\xFF\xD8");
}

TEST_F(Commands, WatchedStatus_IsALineOrADocumentEachTime) {
  start_nodald();
  const Finished lines = nodal({"status", "--watch", "--interval", "20ms", "--count", "3"});
  EXPECT_EQ(lines.code, 0);
  EXPECT_EQ(std::count(lines.out.begin(), lines.out.end(), '\n'), 3);
  EXPECT_EQ(lines.out.find('\x1b'), std::string::npos);
  const std::vector<Json> documents = nodal_json({"status", "--watch", "--interval", "20ms", "--count", "3"});
  ASSERT_EQ(documents.size(), 3U);
  EXPECT_GE(documents[2]["uptime_ns"].get<std::uint64_t>(),
            documents[0]["uptime_ns"].get<std::uint64_t>() + 40'000'000);
}

TEST_F(Commands, CtrlC_EndsAContinuousPullInGoodOrder) {
  start_nodald();
  bring_up();
  const auto pull = start({"--json", "raymap", "pull", "--continuous", "--out", path("live.jpg")});
  ASSERT_TRUE(wait_until([&] { return pull->said().find("\"raymap\"") != std::string::npos; }));
  pull->signal(SIGINT);
  const Finished ended = pull->wait();
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("\"summary\""), std::string::npos);
  EXPECT_EQ(read("live.jpg").substr(0, 2), "\xFF\xD8");
}

TEST_F(Commands, BashCompletion_OffersWhatMayFollow) {
  const auto offered = [this](const std::string& words, const std::string& cursor) {
    const Finished bash = Process({"bash", "-c",
                                   "source <(" NODAL_BIN_DIR "/nodal completion bash); COMP_WORDS=(" + words +
                                       "); COMP_CWORD=" + cursor + "; _nodal; echo \"${COMPREPLY[@]}\""})
                              .wait();
    EXPECT_EQ(bash.code, 0) << bash.err;
    return " " + bash.out;
  };
  EXPECT_NE(offered("nodal cal", "1").find(" calibration"), std::string::npos);
  EXPECT_NE(offered("nodal --json calibration ''", "3").find(" rollback"), std::string::npos);
  EXPECT_NE(offered("nodal raymap pull --fo", "3").find(" --format"), std::string::npos);
  EXPECT_EQ(offered("nodal raymap pull --format ''", "4"), " jpg png tif raw\n");
  EXPECT_EQ(offered("nodal export --format ''", "3"), " pto pts ptv surround360 opencv kalibr\n");
  EXPECT_EQ(offered("nodal register --free l", "3"), " light lens\n");
  EXPECT_EQ(offered("nodal raymap pull -n ''", "4"), " \n") << "a number: no files";
  EXPECT_EQ(offered("nodal genlock s", "2"), " start stop show\n") << "no files where commands belong";
  write("rig-of-mine.json", "");
  EXPECT_EQ(offered("nodal stitch " + path("rig-of"), "2"), " " + path("rig-of-mine.json") + "\n");
}

bool installed(const std::string& program) { return Process({"which", program}).wait().code == 0; }

TEST_F(Commands, FishCompletion_OffersWhatMayFollow) {
  if (!installed("fish")) GTEST_SKIP() << "fish is not installed";
  const auto offered = [this](const std::string& line) {
    const Finished fish =
        Process({"fish", "--no-config", "-c",
                 "cd " + path("") + "; " NODAL_BIN_DIR "/nodal completion fish | source; complete -C '" + line +
                     "' | string split -f1 \\t | string join ' '"})
            .wait();
    EXPECT_EQ(fish.err, "");  // the exit code of `string`: whether it changed anything
    return fish.out;
  };
  EXPECT_EQ(offered("nodal cal"), "calibrate calibration\n");
  EXPECT_EQ(offered("nodal --rig unix:x calibration ro"), "rollback\n");
  EXPECT_EQ(offered("nodal raymap pull --format "), "jpg png raw tif\n");
  EXPECT_EQ(offered("nodal export --format p"), "pto pts ptv\n");
  EXPECT_EQ(offered("nodal completion "), "bash fish zsh\n");
  EXPECT_EQ(offered("nodal raymap pull -n "), "");
  write("rig-of-mine.json", "");
  EXPECT_EQ(offered("nodal stitch rig-of"), "rig-of-mine.json\n");
}

TEST_F(Commands, ZshCompletion_HandsOverWhatMayFollow) {
  if (!installed("zsh")) GTEST_SKIP() << "zsh is not installed";
  const auto offered = [](const std::string& words, const std::string& current) {
    const Finished zsh = Process({"zsh", "-f", "-c",
                                  "_arguments() { print -rl -- \"$@\" }; compdef() { }; "
                                  "source <(" NODAL_BIN_DIR "/nodal completion zsh); words=(" +
                                      words + "); CURRENT=" + current + "; _nodal"})
                             .wait();
    EXPECT_EQ(zsh.code, 0) << zsh.err;
    EXPECT_EQ(zsh.err, "");
    return zsh.out;
  };
  EXPECT_NE(offered("nodal --json calib", "3").find("*:command:(stitch render convert "), std::string::npos);
  EXPECT_NE(offered("nodal export --fo", "3").find(":value:(pto pts ptv surround360 opencv kalibr)\n"),
            std::string::npos);
  EXPECT_NE(offered("nodal raymap pull ''", "4").find(":value:(jpg png tif raw)\n"), std::string::npos);
  EXPECT_NE(offered("nodal stitch ''", "3").find("*:argument:_files\n"), std::string::npos);
  EXPECT_NE(offered("nodal calibration use ''", "4").find("*:argument: \n"), std::string::npos) << "an id is no file";
}

TEST_F(Commands, Hosts_ListsAPullAndEndsIt) {
  start_nodald();
  bring_up();
  const auto pulling = start({"raymap", "pull", "--continuous", "--out", path("live.jpg")});
  Json puller;
  ASSERT_TRUE(wait_until([&] {
    const auto answer = nodal_json({"hosts"});
    for (const Json& host : answer.at(0).at("hosts")) {
      if (host["streams"] == Json{"pulls jpeg"}) puller = host;
    }
    return !puller.is_null();
  }));
  EXPECT_TRUE(puller["software"].get<std::string>().starts_with("nodal "));
  EXPECT_FALSE(puller["asking"]);
  EXPECT_NE(nodal({"hosts"}).out.find("pulls jpeg"), std::string::npos);

  const std::string number = std::to_string(puller["number"].get<int>());
  EXPECT_EQ(nodal({"hosts", "--end", number}).code, 0);
  const Finished ended = pulling->wait();
  EXPECT_NE(ended.code, 0);
  EXPECT_NE(ended.err.find("closed this connection"), std::string::npos) << ended.err;
  EXPECT_NE(nodal({"hosts", "--end", number}).code, 0) << "it is gone";
  EXPECT_EQ(nodal_json({"hosts"}).at(0)["hosts"].size(), 1U) << "only the one that asks";
}

}  // namespace
}  // namespace nodal::command_line
