// A whole first session in a terminal of 80 columns, by what the README and --help say.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "rig_process.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/terminal.h"

namespace nodal::command_line {
namespace {

constexpr std::size_t kColumns = 80;

class WholeSession : public RigTest {
 protected:
  WholeSession() {
    environment_["PATH"] = NODAL_BIN_DIR ":" + std::string(std::getenv("PATH"));
    environment_["NODAL_RIG"] = "unix:" + path("nodal.sock");
    environment_["TERM"] = "xterm";
  }

  /// Types a line in the session's folder; everything that it prints must fit, and it must succeed.
  std::string type(const std::string& line) {
    const test::Shown shown = test::run_in_terminal({"bash", "-c", "cd '" + path(".") + "' && " + line}, environment_);
    transcript_ += "$ " + line + "\n" + shown.text;
    EXPECT_EQ(shown.code, 0) << line << "\n" << shown.text;
    EXPECT_LE(test::widest_line(shown.text), kColumns) << line << "\n" << shown.text;
    EXPECT_EQ(shown.text.find("is no command"), std::string::npos) << line << "\n" << shown.text;
    return shown.text;
  }

  /// Starts what a line "nodald ... &" starts, and waits until it listens.
  void start_daemon(const std::string& line, const std::string& socket) {
    // Without the last " &": a shell that puts it into the background would leave it behind.
    const std::size_t begin = line.rfind("nodald");
    const std::string command = line.substr(begin, line.rfind(" &") - begin);
    daemon_ = std::make_unique<Process>(Words{"bash", "-c", "cd '" + path(".") + "' && exec " + command}, environment_);
    ASSERT_TRUE(wait_until([&] { return std::filesystem::exists(socket); })) << daemon_->complained();
  }

  /// The take that was started has a set: a person takes longer than the first set to come.
  bool wait_for_a_set() {
    return wait_until([this] {
      const auto status = Process({NODAL_BIN_DIR "/nodal", "--json", "status"}, environment_).wait();
      return status.code == 0 && Json::parse(status.out)["recording"].value("sets", 0) > 0;
    });
  }

  std::unique_ptr<Process> daemon_;
  std::string transcript_;
};

/// The commands of a Markdown page, or of what is under a heading of it: its indented lines, without comments.
Words commands_of(const std::string& page, const std::string& heading = "") {
  std::ifstream stream(page);
  Words commands;
  bool here = heading.empty();
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("## ") && !heading.empty()) here = line == "## " + heading;
    if (here && line.starts_with("    ")) commands.push_back(line.substr(4, std::min(line.find("  #"), line.npos) - 4));
  }
  return commands;
}

void replace(std::string& text, const std::string& what, const std::string& by) {
  if (const std::size_t at = text.find(what); at != std::string::npos) text.replace(at, what.size(), by);
}

/// The commands that a help text lists, under one heading or several.
Words listed_in(const std::string& help) {
  Words commands;
  std::istringstream lines(help);
  bool listed = false;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line == "Examples:") break;
    if (line.ends_with(":")) listed = line != "Options:" && line != "Positionals:";
    if (listed && line.starts_with("  ") && line.size() > 2 && line[2] != ' ' && line[2] != '-') {
      commands.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  return commands;
}

TEST_F(WholeSession, HelpOfEveryCommand_FitsTheTerminal) {
  const Words commands = listed_in(type("nodal --help"));
  EXPECT_GE(commands.size(), 20U);
  std::set<std::string> seen;
  for (const std::string& command : commands) {
    seen.insert(command);
    for (const std::string& below : listed_in(type("nodal " + command + " --help"))) {
      type("nodal " + command + " " + below + " --help");
      seen.insert(command + " " + below);
    }
  }
  for (const char* one : {"stitch", "raymap pull", "calibration upload", "take start", "exposure show"}) {
    EXPECT_TRUE(seen.contains(one)) << one;
  }
  type("nodald --help");
  type("nodal --version");
  type("nodald --version");
}

TEST_F(WholeSession, CommandsOfTheReadme_SucceedAndFitTheTerminal) {
  // Three heads of a rig, and two of them as pictures of a hand-held camera.
  Calibration three = test::six_fisheyes(320, 190);
  three.heads.resize(3);
  const test::RenderedRig rig =
      test::render_rig(three, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 2});
  for (std::size_t h = 0; h < 3; ++h) {
    const std::vector<std::uint8_t> png = test::png_of(rig.bytes[h], 320, 320, 3);
    test::write_bytes(path("cam" + std::to_string(h) + ".png"), png);
    if (h < 2) test::write_bytes(path(h == 0 ? "front.jpg" : "back.jpg"), png);
  }
  std::filesystem::remove(path("rig.toml"));
  fake_ssh("exec BRIDGE\n");
  environment_["NODAL_RIG"] = "unix:" + path("nodal.sock");

  const std::string readme = NODAL_SOURCE_DIR "/README.md";
  Words session = commands_of(readme, "With pictures of your own");
  EXPECT_GE(session.size(), 5U);
  const Words with_a_rig = commands_of(readme, "With a rig");
  EXPECT_GE(with_a_rig.size(), 12U);
  session.insert(session.end(), with_a_rig.begin(), with_a_rig.end());
  for (std::string command : session) {
    if (command.starts_with(".setup/install") || command.starts_with("export")) continue;  // done for this test
    if (command.ends_with("&")) {
      type(command.substr(0, command.find(" && ")));
      start_daemon(command, path("nodal.sock"));
      type("nodal status");
      continue;
    }
    replace(command, "--for 10s", "--for 1s");
    if (command.find("--watch") != std::string::npos)
      command = "timeout --foreground --preserve-status -s INT 2 " + command;
    if (command.starts_with("nodal drift")) command += " || [ $? = 10 ]";  // small pictures may not tell
    if (command.starts_with("nodal take stop")) {
      EXPECT_TRUE(wait_for_a_set());
    }
    const std::string shown = type(command);
    if (command.find("-o film.mkv") != std::string::npos) {
      EXPECT_EQ(shown.find("the last is"), std::string::npos) << "a film holds all of them:\n" << shown;
    }
    if (command.find("calibration upload") != std::string::npos) {
      EXPECT_EQ(type("nodal status").find("no calibration is in force"), std::string::npos);
      for (const char* more : {"nodal genlock start", "nodal genlock show", "nodal heads", "nodal exposure show",
                               "nodal calibration list", "nodal calibration show", "nodal hosts", "nodal audit",
                               "nodal raymap pull -o raymap.jpg", "nodal sync report -n 20"}) {
        type(more);
      }
    }
    if (command.starts_with("nodal take stop")) {
      for (const char* more : {"nodal status", "nodal take list", "nodal take still", "nodal take list"}) type(more);
    }
  }
  for (const char* file :
       {"sphere.jpg", "cube.jpg", "view.jpg", "rig.json", "pattern.pdf", "film.mkv", "raymap.jpg", "take.mkv"}) {
    EXPECT_TRUE(std::filesystem::exists(path(file))) << file << "\n" << transcript_;
  }
}

/// Simulated heads, as `nodald --scan` proposes V4L2 devices to a user whose state folder is `state`.
std::string scanned_rig(const std::string& state) {
  std::string toml =
      "[rig]\nname = \"rig\"\nrate = \"25/1\"\n\n[raymap]\nformat = \"I420\"\nwidth = 512\nheight = 256\n\n"
      "[trigger]\nsource = \"none\"\n\n[links]\nunix = \"" +
      state + "/nodal/nodal.sock\"\n\n[store]\nfolder = \"" + state +
      "/nodal\"\n\n# Without these two lines the rig records nothing.\n# [takes]\n# folder = \"" + state +
      "/nodal/takes\"\n\n[sim]\ncalibration = \"truth.json\"\n";
  for (int i = 0; i < 3; ++i) {
    toml += "\n[[heads]]\nname = \"cam" + std::to_string(i) + "\"\nport = \"sim:cam" + std::to_string(i) + "\"\n";
  }
  return toml;
}

TEST_F(WholeSession, CommandsOfTheGuideFromCamerasToAFilm_Succeed) {
  Calibration three = test::six_fisheyes(320, 190);
  three.heads.resize(3);
  write("truth.json", to_json(three));
  std::filesystem::remove(path("rig.toml"));
  environment_.erase("NODAL_RIG");
  environment_["XDG_STATE_HOME"] = path("state");
  if (std::filesystem::exists("/run/nodal/nodal.sock")) GTEST_SKIP() << "a rig runs on this machine";

  const Words guide = commands_of(NODAL_SOURCE_DIR "/host_tool/USB_CAMERAS.md");
  EXPECT_GE(guide.size(), 18U);
  for (std::string command : guide) {
    if (command.starts_with("export")) continue;  // done for this test
    if (command.starts_with("nodald --scan")) {   // there are no cameras
      write("rig.toml", scanned_rig(path("state")));
      continue;
    }
    if (command.ends_with("&")) {
      start_daemon(command, path("state/nodal/nodal.sock"));
      continue;
    }
    if (command.starts_with("nodal drift")) command += " || [ $? = 10 ]";  // small pictures may not tell
    if (command.starts_with("nodal take stop")) {
      EXPECT_TRUE(wait_for_a_set());
    }
    type(command);
  }
  for (const char* file : {"first.json", "first.html", "sphere.jpg", "film.mkv", "better.json"}) {
    EXPECT_TRUE(std::filesystem::exists(path(file))) << file << "\n" << transcript_;
  }
}

}  // namespace
}  // namespace nodal::command_line
