// What each command may do follows from its words.
#include "host_tool/commands/confinement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/completion.h"
#include "tests/support/pictures.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

/// The rights of a command line, which is then not run.
CommandRights rights_for(const std::vector<std::string>& words) {
  std::vector<const char*> all{"nodal"};
  for (const std::string& word : words) all.push_back(word.c_str());
  std::FILE* const nowhere = std::tmpfile();
  Console console(nowhere, nowhere);
  CommandLine line(console, add_all_commands);
  std::optional<CommandRights> rights;
  line.before_command = [&](Context&, const CLI::App& command) -> Status {
    rights = rights_of(command);
    return fail(Errc::kCancelled, "this is enough");
  };
  line.run(static_cast<int>(all.size()), all.data());
  std::fclose(nowhere);
  EXPECT_TRUE(rights) << "the words were refused";
  return rights.value_or(CommandRights());
}

bool has(const std::vector<std::string>& paths, const fs::path& path) {
  return std::ranges::find(paths, path.string()) != paths.end();
}

class Confinement : public testing::Test {
 protected:
  Confinement() {
    fs::create_directories(folder_ / "in/take");
    for (const char* name : {"in/a.png", "in/b.png", "in/rig.pto", "in/rig.json", "in/rig.json.sig", "in/rays.txt"}) {
      std::ofstream(folder_ / name) << "x";
    }
  }
  std::string in(const std::string& name) const { return (folder_ / "in" / name).string(); }
  test::TemporaryFolder folder_;
};

TEST_F(Confinement, EveryOptionThatNamesAFileOrFolder_IsAnInputOrAnOutput) {
  Console console(stdout, stderr);
  CommandLine line(console, add_all_commands);
  int files = 0;
  for (const CommandWords& command : command_words(line.app())) {
    for (const CommandWords::Option& option : command.options) {
      const bool folder = option.type == "FOLDER" || option.type == "DIR";
      if (!option.value.file && !folder) continue;
      ++files;
      EXPECT_NE(path_use(option.names.back().substr(2)), PathUse::kNone)
          << "what is " << option.names.back() << " of `nodal " << (command.path.empty() ? "" : command.path.front())
          << "`? add it to the table in confinement.cpp";
    }
  }
  EXPECT_GT(files, 20);
}

TEST_F(Confinement, Pictures_AreReadAloneAndNotTheirFolder) {
  const CommandRights rights = rights_for({"stitch", in("a.png"), in("b.png"), "-o", (folder_ / "out.jpg").string()});
  EXPECT_TRUE(has(rights.read, in("a.png")));
  EXPECT_TRUE(has(rights.read, in("b.png")));
  EXPECT_FALSE(has(rights.read, folder_ / "in"));
  EXPECT_EQ(rights.write, std::vector<std::string>{folder_.path().string()});
  EXPECT_TRUE(rights.execute.empty());
}

TEST_F(Confinement, AProject_IsReadWithItsFolder_AndWithPicturesAnywhereAll) {
  EXPECT_TRUE(has(rights_for({"stitch", in("rig.pto")}).read, folder_ / "in"));
  EXPECT_FALSE(has(rights_for({"stitch", in("rig.pto")}).read, "/"));
  EXPECT_TRUE(has(rights_for({"stitch", in("rig.pto"), "--pictures-anywhere"}).read, "/"));
}

TEST_F(Confinement, WithoutANameForTheOutput_ThePresentFolderIsWritten) {
  EXPECT_EQ(rights_for({"stitch", in("a.png"), in("b.png")}).write, std::vector<std::string>{"."});
  EXPECT_TRUE(rights_for({"status"}).write.empty());
}

TEST_F(Confinement, AFolderThatIsMade_IsMadeInTheNearestThatExists) {
  const CommandRights rights = rights_for({"offload", "1", "--to", (folder_ / "a/b/c").string()});
  EXPECT_EQ(rights.write, std::vector<std::string>{folder_.path().string()});
}

TEST_F(Confinement, SignaturesAndListsOfRays_AreInputs) {
  EXPECT_TRUE(has(rights_for({"calibration", "upload", in("rig.json")}).read, in("rig.json.sig")));
  EXPECT_TRUE(has(rights_for({"convert", in("a.png"), "-o", "b.png", "--layout", "rays:" + in("rays.txt")}).read,
                  in("rays.txt")));
}

TEST_F(Confinement, OnlyCpfindIsStarted_AndOnlyWhenItIsAskedFor) {
  EXPECT_TRUE(rights_for({"pairs", in("rig.json"), in("a.png")}).execute.empty());
  EXPECT_FALSE(rights_for({"pairs", in("rig.json"), "--cpfind", in("a.png"), in("b.png")}).execute.empty());
}

}  // namespace
}  // namespace nodal::host
