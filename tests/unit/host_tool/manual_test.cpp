// The manual page and the program must agree: every command and option of one is in the other.
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/completion.h"

namespace nodal::host {
namespace {

/// "calibration upload": {"--unchecked", ...}; "" for those under OPTIONS.
using Manual = std::map<std::string, std::set<std::string>>;

Manual read_manual() {
  std::ifstream file(NODAL_SOURCE_DIR "/host_tool/nodal.1");
  Manual manual;
  std::string command;
  bool options_follow = false;
  for (std::string line; std::getline(file, line);) {
    line = std::regex_replace(line, std::regex(R"(\\-)"), "-");
    if (line.starts_with(".SH ")) options_follow = line == ".SH OPTIONS";
    if (line.starts_with(".SH OPTIONS")) command.clear();
    if (line.starts_with(".SS nodal ")) {
      options_follow = true;
      command.clear();
      std::istringstream words(line.substr(10));
      // Command words are in lower case; placeholders (HEAD..., [ID]) are not.
      for (std::string word; words >> word && std::islower(static_cast<unsigned char>(word[0])) != 0;) {
        command += (command.empty() ? "" : " ") + word;
      }
      manual[command];
    }
    if (!options_follow || !line.starts_with(".B")) continue;
    static const std::regex option(R"((^|[ ,"])(--?[A-Za-z][a-z-]*))");
    if (line.find(" -") == std::string::npos && line.find("\"-") == std::string::npos) continue;
    for (std::sregex_iterator it(line.begin(), line.end(), option), end; it != end; ++it) {
      manual[command].insert((*it)[2]);
    }
  }
  return manual;
}

Manual read_program() {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  Manual program;
  std::set<std::string> shared;
  for (const CommandWords& command : command_words(line.app())) {
    if (!command.path.empty() && !command.runs) continue;  // "genlock" itself is not a command
    std::string name;
    for (const std::string& word : command.path) name += (name.empty() ? "" : " ") + word;
    std::set<std::string>& options = program[name];
    for (const CommandWords::Option& option : command.options) {
      for (const std::string& spelling : option.names) {
        if (name.empty()) shared.insert(spelling);
        if (name.empty() || !shared.contains(spelling)) options.insert(spelling);
      }
    }
  }
  return program;
}

TEST(Manual, EveryCommandAndOptionOfTheProgram_IsInIt) {
  const Manual manual = read_manual();
  const Manual program = read_program();
  ASSERT_GE(program.size(), 15U);
  for (const auto& [command, options] : program) {
    ASSERT_TRUE(manual.contains(command)) << "the manual page has no `nodal " << command << "`";
    for (const std::string& option : options) {
      EXPECT_TRUE(manual.at(command).contains(option)) << "`nodal " << command << "` lacks " << option;
    }
  }
}

TEST(Manual, EveryCommandAndOptionInIt_TheProgramHas) {
  const Manual manual = read_manual();
  const Manual program = read_program();
  for (const auto& [command, options] : manual) {
    ASSERT_TRUE(program.contains(command)) << "there is no `nodal " << command << "`";
    for (const std::string& option : options) {
      const bool shared = program.at("").contains(option);
      EXPECT_TRUE(shared || program.at(command).contains(option)) << "`nodal " << command << "` has no " << option;
    }
  }
}

TEST(Manual, EveryExitCode_IsExplained) {
  std::ifstream file(NODAL_SOURCE_DIR "/host_tool/nodal.1");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string status = text.substr(text.find(".SH EXIT STATUS"));
  for (const ExitCodeHelp& help : exit_code_help()) {
    const std::string entry = ".B " + std::to_string(static_cast<int>(help.code)) + "\n";
    const std::size_t at = status.find(entry);
    ASSERT_NE(at, std::string::npos) << entry;
    const std::string meaning(help.meaning.substr(1));  // the manual begins it with a capital letter
    EXPECT_EQ(status.compare(at + entry.size() + 1, meaning.size(), meaning), 0) << help.meaning;
  }
}

// --- completion -----------------------------------------------------------------------------------------

TEST(Completion, EveryShell_KnowsEveryCommandAndOption) {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  const std::vector<CommandWords> commands = command_words(line.app());
  const std::string bash = bash_completion(commands);
  const std::string zsh = zsh_completion(commands);
  const std::string fish = fish_completion(commands);
  for (const auto& [command, options] : read_program()) {
    EXPECT_NE(bash.find("\"" + command + "\""), std::string::npos) << command;
    EXPECT_NE(zsh.find("'" + command + "'"), std::string::npos) << command;
    EXPECT_NE(fish.find("__nodal_at " + command), std::string::npos) << command;
    for (const std::string& option : options) {
      EXPECT_NE(bash.find(option), std::string::npos) << option;
      EXPECT_NE(zsh.find(option + "["), std::string::npos) << option;
      const std::string name = option.substr(option.find_first_not_of('-'));
      EXPECT_NE(fish.find((option.starts_with("--") ? " -l " : " -s ") + name), std::string::npos) << option;
    }
  }
}

TEST(Completion, Values_AreThoseThatAnOptionHas_AndNoPlaceholders) {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  const std::string bash = bash_completion(command_words(line.app()));
  const auto offered = [&](const std::string& option) {
    const std::size_t at = bash.find("\"" + option + "\")");
    return at == std::string::npos ? "no " + option : bash.substr(at, bash.find('\n', at) - at);
  };
  EXPECT_NE(offered("view --camera").find("-W \"perspective fisheye "), std::string::npos) << offered("view --camera");
  EXPECT_NE(offered("view --camera").find(" pannini "), std::string::npos);
  EXPECT_NE(offered("convert --layout").find(" healpix "), std::string::npos) << offered("convert --layout");
  EXPECT_NE(offered("convert --from").find(" healpix "), std::string::npos);
  EXPECT_NE(offered("view --envelope").find("compgen -f"), std::string::npos) << offered("view --envelope");
  EXPECT_EQ(bash.find("NAME:"), std::string::npos);
}

}  // namespace
}  // namespace nodal::host
