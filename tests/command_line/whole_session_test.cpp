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
    environment_["NODAL_RIG"] = "unix:nodal.sock";
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

  std::unique_ptr<Process> daemon_;
  std::string transcript_;
};

/// The commands of a Markdown page under a heading: its indented lines that call nodal or nodald, without comments.
Words commands_under(const std::string& page, const std::string& heading) {
  std::ifstream stream(page);
  Words commands;
  bool here = false;
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("## ")) here = line == "## " + heading;
    if (!here || !(line.starts_with("    nodal") || line.starts_with("    build/release/bin/nodal"))) continue;
    std::string command = line.substr(4, line.find("  #") == std::string::npos ? line.npos : line.find("  #") - 4);
    if (command.starts_with("build/release/bin/")) command.erase(0, std::string("build/release/bin/").size());
    commands.push_back(command);
  }
  return commands;
}

void replace(std::string& text, const std::string& what, const std::string& by) {
  if (const std::size_t at = text.find(what); at != std::string::npos) text.replace(at, what.size(), by);
}

/// The commands that a help text lists.
Words listed_in(const std::string& help) {
  Words commands;
  std::istringstream lines(help.substr(std::min(help.find("\nSubcommands:"), help.size())));
  std::string line;
  std::getline(lines, line);
  std::getline(lines, line);
  while (std::getline(lines, line) && line.starts_with("  ")) {
    if (line[2] != ' ') commands.push_back(line.substr(2, line.find(' ', 2) - 2));
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
  environment_["NODAL_RIG"] = "unix:nodal.sock";

  const std::string readme = NODAL_SOURCE_DIR "/README.md";
  Words session = commands_under(readme, "With pictures of your own");
  EXPECT_GE(session.size(), 3U);
  const Words with_a_rig = commands_under(readme, "With a rig");
  EXPECT_GE(with_a_rig.size(), 12U);
  session.insert(session.end(), with_a_rig.begin(), with_a_rig.end());
  for (std::string command : session) {
    if (command.find("usb:") != std::string::npos) continue;    // needs a board and a cable
    if (command.starts_with("nodald --scan")) continue;         // needs cameras
    if (command.starts_with("nodal calibrate lens")) continue;  // needs photographs; see CalibrationCommands
    if (command.ends_with("&")) {
      // `nodal take` needs a disk, which RIG.md explains.
      type("printf '[takes]\\nfolder = \"recorded\"\\n' >> rig.toml");
      const std::size_t start = command.find("&& nodald");
      ASSERT_NE(start, std::string::npos) << command;
      type(command.substr(0, start));
      daemon_ = std::make_unique<Process>(
          Words{"bash", "-c",
                "cd '" + path(".") + "' && exec " + command.substr(start + 3, command.size() - start - 5)},
          environment_);
      ASSERT_TRUE(wait_until([this] { return std::filesystem::exists(path("nodal.sock")); })) << daemon_->complained();
      type("nodal status");
      continue;
    }
    replace(command, "--for 10s", "--for 1s");
    if (command.find("--watch") != std::string::npos)
      command = "timeout --foreground --preserve-status -s INT 2 " + command;
    type(command);
    if (command.find("calibration upload") != std::string::npos) {
      EXPECT_EQ(type("nodal status").find("no calibration is in force"), std::string::npos);
      for (const char* more : {"nodal genlock start", "nodal genlock show", "nodal heads", "nodal exposure show",
                               "nodal calibration list", "nodal calibration show", "nodal hosts", "nodal audit",
                               "nodal raymap pull -o raymap.jpg", "nodal sync report -n 20"}) {
        type(more);
      }
    }
    if (command.find("take start") != std::string::npos) {
      // A person takes longer than the first set to come; without one there is nothing to render.
      EXPECT_TRUE(wait_until([this] {
        const auto status =
            Process({NODAL_BIN_DIR "/nodal", "--rig", "unix:" + path("nodal.sock"), "--json", "status"}).wait();
        return status.code == 0 && Json::parse(status.out)["recording"].value("sets", 0) > 0;
      }));
      for (const char* more :
           {"nodal status", "nodal take stop", "nodal take list", "nodal take still", "nodal take list"}) {
        type(more);
      }
    }
  }
  for (const char* file :
       {"sphere.jpg", "cube.jpg", "view.jpg", "rig.json", "pattern.pdf", "film.mkv", "raymap.jpg", "takes"}) {
    EXPECT_TRUE(std::filesystem::exists(path(file))) << file << "\n" << transcript_;
  }
}

}  // namespace
}  // namespace nodal::command_line
