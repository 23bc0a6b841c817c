#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <new>
#include <nlohmann/json.hpp>

#include "host_tool/commands/completion.h"
#include "protocol/command_line/usage.h"
#include "run_nodal.h"

namespace nodal::host {
namespace {

TEST(CommandLine, HelpOfEveryCommand_IsThereAndTeachesByExample) {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  for (const CommandWords& command : command_words(line.app())) {
    std::vector<std::string> words = command.path;
    words.push_back("--help");
    const Outcome run(words);
    EXPECT_EQ(run.code, ExitCode::kOk);
    EXPECT_NE(run.out.find("Usage: nodal"), std::string::npos) << run.out;
    if (command.subcommands.empty() || command.path.empty()) {
      EXPECT_NE(run.out.find("Examples:\n  "), std::string::npos) << run.out;
    }
  }
}

TEST(CommandLine, HelpOfAGroup_ShowsNoExamplesOfOtherCommands) {
  for (const char* group : {"raymap", "calibration", "genlock", "exposure", "sync", "calibrate", "head"}) {
    const Outcome run({group, "--help"});
    EXPECT_EQ(run.out.find("Examples:"), std::string::npos) << run.out;
    EXPECT_EQ(run.out.find("Exit codes"), std::string::npos) << run.out;
  }
}

TEST(CommandLine, HelpOfTheProgram_ListsCommandsByWhatTheyAreFor_PicturesFirst) {
  const std::string help = Outcome({"--help"}).out;
  std::size_t at = 0;
  for (const char* next :
       {"Spheres from pictures and films:", "\n  stitch ", "\n  look ", "Lenses and directions:", "\n  register ",
        "\n  drift ", "A rig:", "\n  status ", "\n  take ", "Other:", "Examples:", "nodal stitch a.jpg"}) {
    const std::size_t found = help.find(next, at);
    ASSERT_NE(found, std::string::npos) << next << " after " << at << ":\n" << help;
    at = found;
  }
  EXPECT_EQ(help.find("Subcommands:"), std::string::npos) << "a command without a heading:\n" << help;
}

TEST(CommandLine, HelpOfEveryOption_ListsItsChoicesOnceAndItsRangeInWords) {
  const std::string help = Outcome({"register", "--help"}).out;
  EXPECT_NE(help.find("--norm sum|max "), std::string::npos) << help;
  EXPECT_NE(help.find("--threads N (1 to 256)"), std::string::npos) << help;
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  for (const CommandWords& command : command_words(line.app())) {
    std::vector<std::string> words = command.path;
    words.push_back("--help");
    const std::string text = Outcome(words).out;
    EXPECT_EQ(text.find(":{"), std::string::npos) << text;
    EXPECT_EQ(text.find("INT in"), std::string::npos) << text;
    EXPECT_EQ(text.find("FLOAT in"), std::string::npos) << text;
  }
}

TEST(CommandLine, WhatCannotBeUnderstood_IsUsageAndSaysWhere) {
  const std::vector<std::vector<std::string>> wrong{{},
                                                    {"stauts"},
                                                    {"status", "--wacth"},
                                                    {"status", "more"},
                                                    {"head", "set", "0"},
                                                    {"head", "set", "--gain", "1dB"},
                                                    {"head", "set", "0", "--gain", "6"},
                                                    {"head", "set", "0", "--exposure", "0"},
                                                    {"genlock"},
                                                    {"genlock", "begin"},
                                                    {"genlock", "start", "--rate", "fast"},
                                                    {"calibration", "upload"},
                                                    {"calibration", "use"},
                                                    {"raymap", "pull", "-n", "0"},
                                                    {"raymap", "pull", "-n", "2", "--continuous"},
                                                    {"raymap", "pull", "--for", "5"},
                                                    {"raymap", "pull", "--format", "bmp"},
                                                    {"completion", "tcsh"},
                                                    {"--rig", "rig.local", "status"},
                                                    {"--timeout", "5", "status"},
                                                    {"import"}};
  for (const auto& words : wrong) {
    const Outcome run(words);
    std::string line;
    for (const std::string& word : words) line += " " + word;
    EXPECT_EQ(run.code, ExitCode::kUsage) << "nodal" << line;
    EXPECT_NE(run.err.find("nodal: "), std::string::npos) << "nodal" << line;
    EXPECT_EQ(run.out, "") << "nodal" << line;
  }
}

TEST(CommandLine, AWordThatIsNoChoice_IsAnsweredWithTheChoicesAndTheNearestOne) {
  EXPECT_NE(Outcome({"stitch", "a", "b", "--transition", "feathr"})
                .err.find("--transition: 'feathr' is not one of two-band, seam, feather; did you mean 'feather'?"),
            std::string::npos);
  EXPECT_NE(Outcome({"completion", "tcsh"}).err.find("SHELL: 'tcsh' is not one of bash, zsh, fish"), std::string::npos);
  EXPECT_EQ(Outcome({"stitch", "a", "b", "--bits", "9"}).err.find('{'), std::string::npos);
}

/// The one error document on standard output.
nlohmann::json usage_document_of(const Outcome& run, const std::string& line) {
  EXPECT_EQ(run.code, ExitCode::kUsage) << line;
  EXPECT_EQ(std::ranges::count(run.out, '\n'), 1) << line << "\n" << run.out;
  const auto document = nlohmann::json::parse(run.out, nullptr, false);
  EXPECT_TRUE(document.is_object() && document.contains("error")) << line << "\n" << run.out;
  return document.is_object() ? document.value("error", nlohmann::json::object()) : nlohmann::json::object();
}

TEST(CommandLine, WithJson_EveryUsageErrorIsOneDocument_WhereverTheFlagStands) {
  const std::vector<std::vector<std::string>> wrong{{"head", "set", "all", "--exposure", "1/0"},
                                                    {"head", "set", "cam0", "--gain", "900dB"},
                                                    {"head", "set", "cam0", "--wb", "x"},
                                                    {"exposure", "set", "--longest", "5"},
                                                    {"stitch", "a.png", "b.png", "--quality", "bst"},
                                                    {"stitch", "a.png", "b.png", "--blend", "bst"},
                                                    {"raymap", "pull", "-n", "0"},
                                                    {"status", "--interval", "5"},
                                                    {"--timeout", "-1s", "status"},
                                                    {"--rig", "foo", "status"},
                                                    {"--timeout"},
                                                    {"stauts"},
                                                    {"status", "--wacth"},
                                                    {"status", "more"},
                                                    {"import"},
                                                    {}};
  for (std::vector<std::string> words : wrong) {
    std::string line = "nodal";
    for (const std::string& word : words) line += " " + word;
    words.insert(words.begin(), "--json");
    EXPECT_FALSE(usage_document_of(Outcome(words), line).value("message", "").empty()) << line;
    if (words.back() == "--timeout") continue;  // would take --json as its value
    std::ranges::rotate(words, words.begin() + 1);
    EXPECT_FALSE(usage_document_of(Outcome(words), line).value("message", "").empty()) << line;
  }
}

TEST(CommandLine, AWrongValueOfAnyOption_IsAUsageErrorThatNamesTheOption) {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  int tried = 0;
  for (const CommandWords& command : command_words(line.app())) {
    for (const CommandWords::Option& option : command.options) {
      const bool any_text = option.value.file || option.type == "NAME" || option.type == "TEXT" ||
                            option.type == "HEAD" || option.type == "PATTERN" || option.type == "HTML" ||
                            option.type == "FOLDER" || option.type == "DIR";
      if (option.type.empty() || any_text || !command.runs) continue;
      // Those of all commands are judged after the command's own words, which are missing here.
      const bool of_all = option.names.back() == "--rig" || option.names.back() == "--timeout";
      std::vector<std::string> words = command.path;
      words.insert(words.end(), {"--json", option.names.back(), "?!"});
      std::string shown;
      for (const std::string& word : words) shown += " " + word;
      const std::string message = usage_document_of(Outcome(words), shown).value("message", "");
      EXPECT_TRUE(message.starts_with(option.names.back()) || (of_all && message.ends_with(" required")))
          << shown << ": " << message;
      ++tried;
    }
  }
  EXPECT_GT(tried, 60);
}

TEST(CommandLine, AValueThatOnlyTheCommandCanJudge_HasTheSameExitCodeAndDocument) {
  const std::vector<std::vector<std::string>> wrong{{"pattern", "-o", "pattern.bmp"},
                                                    {"mesh", "-o", "a.obj", "--size", "64x32", "--texture", "a.png"}};
  for (std::vector<std::string> words : wrong) {
    const std::string line = words.front();
    words.push_back("--json");
    const nlohmann::json error = usage_document_of(Outcome(words), line);
    EXPECT_EQ(error.value("name", ""), "usage") << line;
    EXPECT_TRUE(error.value("message", "").starts_with("--")) << line;
  }
}

TEST(CommandLine, NumbersThatAreNone_OrOutOfRange_AreSaidInPlainWords) {
  const auto said = [](std::vector<std::string> words) {
    words.insert(words.begin(), {"view", "a.png", "-o", "b.png"});
    return Outcome(words).err;
  };
  EXPECT_NE(said({"--fov", "90deg"}).find("nodal: --fov: '90deg' is not a number\n"), std::string::npos)
      << said({"--fov", "90deg"});
  EXPECT_NE(said({"--pitch", "91"}).find("--pitch: '91' is not a number from -90 to 90\n"), std::string::npos)
      << said({"--pitch", "91"});
}

TEST(CommandLine, ARange_ReadsTheSameFromEveryVersionOfCli11) {
  const CLI::App app;
  for (const char* const says : {"Value 91 not in range -90.000000 to 90.000000", "Value 91 not in range -90 to 90",
                                 "Value 91 not in range [-90 - 90]"}) {
    EXPECT_EQ(explain_usage(app, CLI::ValidationError("--pitch", says)),
              "--pitch: '91' is not a number from -90 to 90");
  }
  EXPECT_EQ(explain_usage(app, CLI::ValidationError("--tolerance", "Value x not in range 0.001000 to 1000")),
            "--tolerance: 'x' is not a number from 0.001 to 1000");
}

TEST(CommandLine, AWordThatIsNoCommand_IsNamedWithTheNearestThatIs) {
  EXPECT_NE(Outcome({"statsu"}).err.find("there is no command `nodal statsu`; did you mean 'status'?"),
            std::string::npos)
      << Outcome({"statsu"}).err;
  const Outcome pull({"raymap", "pul"});
  EXPECT_NE(pull.err.find("there is no command `nodal raymap pul`; did you mean 'pull'?"), std::string::npos)
      << pull.err;
  EXPECT_NE(pull.err.find("Run `nodal raymap --help`."), std::string::npos) << pull.err;
  const Outcome none({"offload-everything"});
  EXPECT_NE(none.err.find("`nodal offload-everything`; there are stitch, render, convert"), std::string::npos)
      << none.err;
  EXPECT_NE(Outcome({"genlock"}).err.find("`nodal genlock` needs a command: "), std::string::npos)
      << Outcome({"genlock"}).err;
}

TEST(CommandLine, AnOptionThatIsNotThere_IsNamedWithTheNearestThatIs) {
  const Outcome run({"status", "--wach"});
  EXPECT_NE(run.err.find("`nodal status` has no option '--wach'; did you mean '--watch'?"), std::string::npos)
      << run.err;
  const Outcome above({"status", "--tiemout=3s"});  // one that all commands have, with its value
  EXPECT_NE(above.err.find("did you mean '--timeout'?"), std::string::npos) << above.err;
  const Outcome extra({"status", "now"});
  EXPECT_NE(extra.err.find("`nodal status` does not take the argument 'now'"), std::string::npos) << extra.err;
}

TEST(CommandLine, AWordThatIsNoCommand_IsShownWithoutControlCharacters) {
  const Outcome run({"\x1b[2Jstatus\n"});
  EXPECT_EQ(run.code, ExitCode::kUsage);
  EXPECT_EQ(run.err.find('\x1b'), std::string::npos);
}

TEST(CommandLine, Help_HasNoWordsOfTheLibrary) {
  const std::string help = Outcome({"raymap", "pull", "--help"}).out;
  for (const char* word : {"Excludes:", "Needs:", " in [", "INT"})
    EXPECT_EQ(help.find(word), std::string::npos) << help;
  EXPECT_NE(Outcome({"raymap", "pull", "--count", "1", "--for", "1s"}).err.find("--count"), std::string::npos)
      << "what excludes what is said when it matters";
}

TEST(CommandLine, HelpAndVersion_AreWordsToo) {
  EXPECT_EQ(Outcome({"help"}).out, Outcome({"--help"}).out);
  EXPECT_EQ(Outcome({"help", "raymap", "pull"}).out, Outcome({"raymap", "pull", "--help"}).out);
  for (const char* word : {"version", "-V"}) EXPECT_EQ(Outcome({word}).out, Outcome({"--version"}).out) << word;
  EXPECT_EQ(Outcome({"help"}).code, ExitCode::kOk);
}

TEST(CommandLine, NobodyAtTheAddress_IsUnreachableForPeopleAndPrograms) {
  const Outcome run({"--rig", "unix:/nonexistent/nodal.sock", "--json", "status"});
  EXPECT_EQ(run.code, ExitCode::kUnreachable);
  EXPECT_NE(run.err.find("/nonexistent/nodal.sock"), std::string::npos) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_EQ(json["error"]["code"], 305);
  EXPECT_EQ(json["error"]["name"], "unreachable");
}

TEST(CommandLine, SshProgramThatIsNotThere_IsUnreachableAndNamesIt) {
  setenv("NODAL_SSH", "/nonexistent/ssh", 1);
  const Outcome run({"--rig", "ssh://rig.local", "status"});
  unsetenv("NODAL_SSH");
  EXPECT_EQ(run.code, ExitCode::kUnreachable);
  EXPECT_NE(run.err.find("/nonexistent/ssh"), std::string::npos) << run.err;
}

TEST(CommandLine, RigFromTheEnvironment_IsUsedWhenNoneIsGiven) {
  setenv("NODAL_RIG", "unix:/nonexistent/from-environment", 1);
  const Outcome from_environment({"status"});
  const Outcome from_option({"status", "--rig", "unix:/nonexistent/from-option"});
  unsetenv("NODAL_RIG");
  EXPECT_NE(from_environment.err.find("from-environment"), std::string::npos);
  EXPECT_NE(from_option.err.find("from-option"), std::string::npos);
}

TEST(ExitCodes, EveryError_GoesByItsHundreds) {
  EXPECT_EQ(exit_code_of(Errc::kBadValue), ExitCode::kBadInput);
  EXPECT_EQ(exit_code_of(Errc::kNotARotation), ExitCode::kBadInput);
  EXPECT_EQ(exit_code_of(Errc::kLinkClosed), ExitCode::kUnreachable);
  EXPECT_EQ(exit_code_of(Errc::kDeviceGone), ExitCode::kDevice);
  EXPECT_EQ(exit_code_of(Errc::kDiskFull), ExitCode::kStorage);
  EXPECT_EQ(exit_code_of(Errc::kNotReady), ExitCode::kNotNow);
  EXPECT_EQ(exit_code_of(Errc::kBusy), ExitCode::kNotNow);
  EXPECT_EQ(exit_code_of(Errc::kInternal), ExitCode::kFailed);
  EXPECT_EQ(exit_code_of(static_cast<Errc>(1234)), ExitCode::kFailed);
}

// --- the example calibration ----------------------------------------------------------------------------

TEST(ExampleCalibration, TenHeads_SeeTheWholeSphere) {
  const Outcome run({"--json", "calibration", "check", NODAL_SOURCE_DIR "/host_tool/example/ten_heads.json"});
  ASSERT_EQ(run.code, ExitCode::kOk) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_EQ(json["heads"].size(), 10U);
  EXPECT_EQ(json["unseen"], 0.0);
  EXPECT_GT(json["seen_twice"], 0.3);
  const double places[10][2] = {{0, 30},    {90, 30},    {180, 30},  {-90, 30}, {45, -30},
                                {135, -30}, {-135, -30}, {-45, -30}, {0, 90},   {45, -90}};
  for (std::size_t i = 0; i < 10; ++i) {
    const auto& head = json["heads"][i];
    EXPECT_NEAR(head["horizontal_field_deg"], 98, 1.5);
    EXPECT_NEAR(head["pitch_deg"], places[i][1], 1e-6);
    EXPECT_NEAR(std::remainder(head["yaw_deg"].get<double>() - places[i][0], 360), 0, 1e-6);
  }
}

TEST(CalibrationCheck, FileThatIsNotThere_IsAStorageError) {
  EXPECT_EQ(Outcome({"calibration", "check", "/nonexistent.json"}).code, ExitCode::kStorage);
}

TEST(CommandLine, MemoryThatRunsOut_IsOneErrorAndNoAbort) {
  std::FILE* out = std::tmpfile();
  std::FILE* err = std::tmpfile();
  Console console(out, err);
  CommandLine line(console, add_all_commands);
  line.on(line.app().add_subcommand("eat"), [](Context&) -> Status { throw std::bad_alloc(); });
  const std::array<const char*, 2> words{"nodal", "eat"};
  EXPECT_EQ(line.run(2, words.data()), ExitCode::kNotNow);
  std::rewind(err);
  std::array<char, 200> said{};
  ASSERT_NE(std::fgets(said.data(), said.size(), err), nullptr);
  EXPECT_NE(std::string(said.data()).find("not enough memory"), std::string::npos) << said.data();
  std::fclose(out);
  std::fclose(err);
}

}  // namespace
}  // namespace nodal::host
