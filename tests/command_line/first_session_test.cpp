// What a new user meets in the first hour: pictures that are missing or of another size, a second nodald, 80 columns.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"

namespace nodal::command_line {
namespace {

class FirstSession : public RigTest {
 protected:
  /// Writes replay.toml with one head at `port`; returns nodald's --check of it.
  Finished check_replay(const std::string& port) const {
    write("replay.toml",
          "[rig]\nname = \"replay\"\n[raymap]\nwidth = 256\nheight = 128\n[links]\nunix = \"r.sock\"\n[store]\n"
          "folder = \"store\"\n[[heads]]\nname = \"cam0\"\nport = '" +
              port + "'\n");
    return Process({NODAL_BIN_DIR "/nodald", "--config", path("replay.toml"), "--check"}).wait();
  }
  void write_picture(const std::string& name, int width, int height) const {
    test::write_bytes(path(name), test::png_of(test::smooth_rgb(width, height), width, height, 3));
  }
  /// A Hugin project of two pictures of 64x48.
  std::string project(const std::string& first, const std::string& second) const {
    std::string text = "p f2 w2048 h1024 v360 n\"TIFF_m\"\n";
    for (const auto& [yaw, file] : {std::pair{0, first}, {180, second}}) {
      text += "i w64 h48 f3 v190 a0 b0 c0 d0 e0 y" + std::to_string(yaw) + " p0 r0 n\"" + file + "\"\n";
    }
    return write("project.pto", text);
  }
  static std::size_t widest_line(const std::string& text) {
    std::size_t widest = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      const auto continued = [](char c) {
        return (static_cast<unsigned char>(c) & 0xC0) == 0x80;
      };  // bytes that continue a UTF-8 character
      widest = std::max(widest, line.size() - static_cast<std::size_t>(std::ranges::count_if(line, continued)));
    }
    return widest;
  }
};

TEST_F(FirstSession, CheckOfReplayedPictures_RefusesWhatCannotBePlayedAndNamesTheHead) {
  write_picture("cam0.png", 64, 48);
  const Finished good = check_replay("replay:cam0.png");
  EXPECT_EQ(good.code, 0) << good.err;
  write("cam0.mp4", "not a picture");
  for (const char* port : {"replay:cam0.mp4", "replay:nowhere.png", R"(replay:c:\Users\me\cam0.jpg)"}) {
    const Finished refused = check_replay(port);
    EXPECT_EQ(refused.code, 2) << port << refused.err;
    EXPECT_NE(refused.err.find("head 'cam0' (line 10 of rig.toml)"), std::string::npos) << refused.err;
  }
}

TEST_F(FirstSession, SecondNodaldOnOneSocket_EndsBeforeItRenders) {
  start_nodald();
  // Rendering these heads takes more than a minute of computation.
  write("large.json", to_json(six_heads("large", 4000)));
  std::string toml = read("rig.toml");
  toml.replace(toml.find("truth.json"), std::string("truth.json").size(), "large.json");
  write("second.toml", toml);
  Process second({NODAL_BIN_DIR "/nodald", "--config", path("second.toml"), "--store", path("other")});
  const Finished ended = second.wait(std::chrono::seconds(20));
  EXPECT_EQ(ended.code, 3) << ended.err;
  EXPECT_NE(ended.err.find("nodal.sock"), std::string::npos) << ended.err;
  EXPECT_EQ(nodal({"status"}).code, 0);
}

TEST_F(FirstSession, Installed_HasAnExampleThatRunsTheCompletionsAndTheExplanationOfEveryKey) {
  const Finished installed = Process({"cmake", "--install", NODAL_BIN_DIR "/..", "--prefix", path("usr")}).wait();
  ASSERT_EQ(installed.code, 0) << installed.err;
  EXPECT_NE(read("usr/share/bash-completion/completions/nodal").find("complete -o filenames -F _nodal nodal"),
            std::string::npos);
  EXPECT_NE(read("usr/share/fish/vendor_completions.d/nodal.fish").find("complete -c nodal"), std::string::npos);
  EXPECT_TRUE(read("usr/share/zsh/vendor-completions/_nodal").starts_with("#compdef nodal"));
  EXPECT_NE(read("usr/share/doc/nodald/RIG.md").find("rig.toml"), std::string::npos);
  const Finished check =
      Process({path("usr/bin/nodald"), "--config", path("usr/share/doc/nodald/example/rig.toml"), "--check"}).wait();
  EXPECT_EQ(check.code, 0) << check.err;
  // The example in the sources names files that are there, too.
  const Finished source =
      Process({NODAL_BIN_DIR "/nodald", "--config", NODAL_SOURCE_DIR "/firmware/example.rig.toml", "--check"}).wait();
  EXPECT_EQ(source.code, 0) << source.err;
}

TEST_F(FirstSession, TablesOfARunningRig_FitIntoEightyColumns) {
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"exposure", "set", "joint", "--anchor", "cam0"}).code, 0);
  for (const Words& words : {Words{"status"}, {"heads"}, {"exposure", "show"}, {"genlock", "show"}}) {
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_LE(widest_line(run.out), 80U) << run.out;
  }
  EXPECT_NE(nodal({"heads", "--wide"}).out.find("sim:cam5"), std::string::npos);
  EXPECT_NE(nodal({"exposure", "show"}).out.find("exposure at 0 dB"), std::string::npos);
}

TEST_F(FirstSession, ImportOfPicturesOfAnotherSize_WarnsAndNamesHeadAndSizes) {
  write_picture("a.png", 64, 48);
  write_picture("b.png", 32, 24);
  const Finished run = nodal({"import", project("a.png", "b.png"), "-o", path("rig.json")});
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("picture 'b.png' has 32x24 pixels, but the project was made for 64x48"), std::string::npos)
      << run.err;
  EXPECT_EQ(run.err.find("'a.png'"), std::string::npos) << run.err;
}

TEST_F(FirstSession, RigTomlOfPicturesThatCannotBeReplayed_WarnsForEach) {
  write("clip.mp4", "not a picture");
  const Words words{"import", project("clip.mp4", R"(c:\Users\me\b.jpg)"), "-o", path("rig.json")};
  EXPECT_EQ(nodal(words).err.find("b.jpg"), std::string::npos) << "without --rig-toml no picture is needed";
  Words with_toml = words;
  with_toml.insert(with_toml.end(), {"--rig-toml", path("import.toml")});
  const Finished run = nodal(with_toml);
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("heads replay JPEG and PNG pictures only"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find(R"(there is no picture 'c:\Users\me\b.jpg')"), std::string::npos) << run.err;
}

/// The commands of a page: its indented lines that begin with "nodal", without comments.
Words commands_of(const std::string& page) {
  std::ifstream stream(page);
  Words commands;
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("    nodal")) continue;
    commands.push_back(
        line.substr(4, line.find("  #") == std::string::npos ? std::string::npos : line.find("  #") - 4));
  }
  return commands;
}

/// RFC 4648, section 4.
std::vector<std::uint8_t> decoded_base64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  unsigned held = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t digit = digits.find(c);
    if (digit == std::string::npos) break;
    held = held << 6 | static_cast<unsigned>(digit);
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(static_cast<std::uint8_t>(held >> bits));
  }
  return bytes;
}

std::string text_of(const std::string& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST_F(FirstSession, EveryCommandOfTheTutorial_WorksInItsOrder) {
  const test::RenderedRig rig = [] {
    Calibration three = test::six_fisheyes(320, 190);
    three.heads = {three.heads[0], three.heads[1], three.heads[2]};
    const char* const names[] = {"a", "b", "c"};
    for (std::size_t h = 0; h < 3; ++h) three.heads[h].name = names[h];
    return test::render_rig(three, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 2});
  }();
  for (const char* folder : {".", "holiday", "new", "day1", "day2", "day3"}) {
    std::filesystem::create_directories(path(folder));
    for (std::size_t h = 0; h < 3; ++h) {
      test::write_bytes(path(std::string(folder) + "/" + rig.truth.heads[h].name + ".jpg"),
                        test::png_of(rig.bytes[h], 320, 320, 3));
    }
  }
  std::filesystem::remove(path("rig.toml"));  // RigTest's; a new user has none
  const bool films = Process({"sh", "-c", "command -v ffmpeg"}).wait().code == 0;
  for (const HeadCalibration& head : rig.truth.heads) {
    if (!films) break;
    // All cameras hear the same, from which their films' times are found.
    const Finished made =
        Process({"ffmpeg", "-v", "error", "-nostdin", "-loop", "1", "-framerate", "5", "-t", "12", "-i",
                 path("new/" + head.name + ".jpg"), "-f", "lavfi", "-i", "anoisesrc=seed=7:duration=12:amplitude=0.3",
                 "-pix_fmt", "yuv420p", path(head.name + ".mp4")})
            .wait();
    ASSERT_EQ(made.code, 0) << made.err;
  }
  const Words commands = commands_of(NODAL_SOURCE_DIR "/host_tool/TUTORIAL.md");
  ASSERT_GE(commands.size(), 9U);
  std::string log;
  for (const std::string& command : commands) {
    if (command.starts_with("nodal stitch theta.jpg")) continue;  // needs two circles; tests of --split have them
    if (!films && command.find(".mp4") != std::string::npos) continue;
    // nodald goes on in the background until the end of the test.
    std::string script = "cd '" + path(".") + "' && unset NODAL_OVERWRITE && export PATH='" NODAL_BIN_DIR "':$PATH; ";
    if (command.ends_with("&")) {
      const std::size_t start = command.find("&& nodald");
      ASSERT_NE(start, std::string::npos) << command;
      script += command.substr(0, start) + "&& { timeout 240 " + command.substr(start + 3, command.size() - start - 4) +
                " >nodald.log 2>&1 & echo $! > nodald.pid; } && for n in $(seq 100); do [ -S nodal.sock ] && break; "
                "sleep 0.1; done";
    } else if (command.starts_with("nodal look")) {  // it serves its page until it is ended
      script +=
          command +
          " >look.out & for n in $(seq 300); do grep -q http look.out && break; sleep 0.1; done; kill $! && wait $!";
    } else {
      script += command;
    }
    const Finished run = Process({"bash", "-c", script}).wait();
    log += "$ " + command + "\n" + run.out;
    EXPECT_EQ(run.code, 0) << command << "\n" << run.err;
    if (command.ends_with("status")) {
      EXPECT_LE(widest_line(run.out), 80U) << run.out;
    }
  }
  Process({"bash", "-c",
           "pid=$(cat '" + path("nodald.pid") +
               "'); kill $pid; for n in $(seq 100); do kill -0 $pid 2>/dev/null || break; sleep 0.1; done"})
      .wait();
  for (const char* file : {"sphere.jpg", "sphere.rig.json", "sphere.report.html", "holiday.jpg", "next.jpg",
                           "better.html", "rig.json", "raymap.jpg"}) {
    EXPECT_TRUE(std::filesystem::exists(path(file))) << file << "\n" << log;
  }
  EXPECT_NE(log.find("3 of 3 pictures placed"), std::string::npos) << log;
  // The report's verdict comes first, and then the sphere, in colour.
  const std::string page = read("sphere.report.html");
  const std::size_t picture = page.find(";base64,");
  ASSERT_NE(picture, std::string::npos);
  const std::size_t word = page.find("<p class=\"summary\">") + std::string("<p class=\"summary\">").size();
  EXPECT_TRUE(page.substr(word, 4) == "Good" || page.substr(word, 6) == "Usable" || page.substr(word, 7) == "Look at")
      << page.substr(word, 80);
  EXPECT_LT(word, picture);
  EXPECT_LT(picture, page.find("<summary>How the pictures were registered</summary>"))
      << "what is for engineers comes last, folded";
  const std::vector<std::uint8_t> bytes =
      decoded_base64(page.substr(picture + 8, page.find('"', picture) - picture - 8));
  const auto sphere = media::decode_image(bytes, "sphere", PixelFormat::kRgb24);
  ASSERT_TRUE(sphere) << sphere.error().text();
  std::size_t coloured = 0;
  for (std::size_t p = 0; p < sphere->bytes.size(); p += 3) {
    coloured += std::abs(sphere->bytes[p] - sphere->bytes[p + 2]) > 20 ? 1U : 0U;
  }
  EXPECT_GT(coloured, sphere->bytes.size() / 3 / 20);
}

TEST_F(FirstSession, Versions_AreThoseOfTheChangelogTheProtocolsChangesAndCMake) {
  // The newest heading of the changelog, "## 1.2.3" with or without a remark.
  const std::string log = text_of(NODAL_SOURCE_DIR "/.github/CHANGELOG.md");
  const std::size_t heading = log.find("\n## ");
  ASSERT_NE(heading, std::string::npos);
  const std::string newest = log.substr(heading + 4, log.find_first_of(" \n", heading + 4) - heading - 4);
  EXPECT_EQ(nodal({"--version"}).out, "nodal " + newest + "\n");
  EXPECT_EQ(Process({NODAL_BIN_DIR "/nodald", "--version"}).wait().out, "nodald " + newest + "\n");
  // The last row of the table: | protocol version | first in | what |
  const std::string changes = text_of(NODAL_SOURCE_DIR "/protocol/CHANGES.md");
  std::string last;
  std::istringstream lines(changes);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("| ") && std::isdigit(static_cast<unsigned char>(line[2])) != 0) last = line;
  }
  EXPECT_NE(last.find("| " + newest + " |"), std::string::npos) << last;
  const std::string cache = text_of(NODAL_BIN_DIR "/../CMakeCache.txt");
  EXPECT_NE(cache.find("\nCMAKE_PROJECT_VERSION:STATIC=" + newest + "\n"), std::string::npos);
}

TEST_F(FirstSession, ACommand_LeavesAtMostOneLineInTheRigsLog) {
  start_nodald();
  bring_up();
  ASSERT_EQ(nodal({"calibration", "upload", path("six.json")}).code, 0);
  write("bad.json", "{}");
  std::string many = to_json(six_heads("seventh"));
  many.replace(many.find("\"cam0\""), 6, "\"camX\"");
  write("other.json", many);
  const auto lines = [&] {
    const std::string log = nodald().complained();
    return std::ranges::count(log, '\n');
  };
  // The log is written by a thread of its own: a marker at the end shows that everything before it is there.
  const auto lines_after = [&] {
    const auto before = lines();
    EXPECT_EQ(nodal({"head", "set", "cam0", "--gain", "1dB"}).code, 0);
    EXPECT_TRUE(wait_until([&] { return lines() > before; }));
    return lines();
  };
  for (const Words& words : {Words{"status"},
                             {"heads"},
                             {"exposure", "show"},
                             {"audit"},
                             {"calibration", "list"},
                             {"calibration", "show"},
                             {"head", "set", "all", "--exposure", "8ms"},
                             {"head", "set", "all", "--exposure", "9s"},
                             {"calibration", "upload", path("six.json")},
                             {"calibration", "upload", path("bad.json")},
                             {"calibration", "upload", path("other.json")},
                             {"calibration", "rollback"},
                             {"take", "start"},
                             {"raymap", "pull", "-o", path("r.jpg")}}) {
    const auto before = lines_after();
    nodal(words);
    const auto after = lines_after();
    EXPECT_LE(after - before, 2) << words[0] << " " << words[1] << ", and the marker\n" << nodald().complained();
  }
}

}  // namespace
}  // namespace nodal::command_line
