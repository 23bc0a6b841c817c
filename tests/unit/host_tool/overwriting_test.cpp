// Files that are there: every command refuses them, unless it is told to replace them.
#include "host_tool/console/overwriting.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/confinement.h"
#include "host_tool/console/files.h"
#include "tests/support/pictures.h"

namespace nodal::host {
namespace {

class Overwriting : public testing::Test {
 protected:
  void SetUp() override { set_overwriting(false); }
  void TearDown() override { set_overwriting(false); }
  /// As another program made it.
  std::string existing(const std::string& name, const std::string& text = "precious") const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  const test::TemporaryFolder folder_;
};

TEST_F(Overwriting, EveryOutputOfEveryCommand_IsRefusedIfItIsThere) {
  std::FILE* const out = std::tmpfile();
  Console console(out, out);
  CommandLine line(console, add_all_commands);
  set_overwriting(false);  // whatever the environment says
  const std::string file = existing("file.jpg");
  int outputs = 0;
  const std::function<void(CLI::App&)> look = [&](CLI::App& app) {
    for (CLI::Option* const option : app.get_options()) {
      if (option->get_lnames().empty() || path_use(option->get_lnames().front()) != PathUse::kOutputFile) continue;
      ++outputs;
      const std::string name = app.get_name() + " --" + option->get_lnames().front();
      option->add_result(file);
      const Status refused = check_outputs(app);
      ASSERT_FALSE(refused) << name;
      EXPECT_EQ(refused.error().code, Errc::kExists) << name;
      EXPECT_NE(refused.error().message.find(file), std::string::npos) << name;
      set_overwriting(true);
      EXPECT_TRUE(check_outputs(app)) << name;
      set_overwriting(false);
      option->clear();
    }
    for (CLI::App* const command : app.get_subcommands({})) look(*command);
  };
  look(line.app());
  EXPECT_GE(outputs, 20);
  std::fclose(out);
}

TEST_F(Overwriting, AFileWithOtherBytes_StaysAsItIs) {
  const std::string file = existing("x");
  const Status refused = write_file(file, std::string_view("other"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kExists);
  EXPECT_NE(refused.error().message.find(file), std::string::npos);
  EXPECT_EQ(read_file(file, 100).value(), "precious");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()), {}), 1) << "nothing else is left";
  set_overwriting(true);
  ASSERT_TRUE(write_file(file, std::string_view("other")));
  EXPECT_EQ(read_file(file, 100).value(), "other");
}

TEST_F(Overwriting, AFileWithTheSameBytes_IsNoErrorAndIsNotWritten) {
  const std::string file = existing("x");
  const auto before = std::filesystem::last_write_time(file);
  EXPECT_TRUE(write_file(file, std::string_view("precious")));
  EXPECT_EQ(std::filesystem::last_write_time(file), before);
}

TEST_F(Overwriting, AFileThatThisProgramWrote_IsReplaced) {
  ASSERT_TRUE(write_file(path("live"), std::string_view("1")));
  ASSERT_TRUE(write_file(path("live"), std::string_view("2")));
  EXPECT_EQ(read_file(path("live"), 100).value(), "2");
}

TEST_F(Overwriting, AFileThatComesWhileACommandWorks_IsNotReplaced) {
  existing("x");
  const std::string made = existing("made", "result");
  EXPECT_EQ(rename_to_free(made, path("x")), EEXIST);
  EXPECT_EQ(read_file(path("x"), 100).value(), "precious");
  EXPECT_EQ(rename_to_free(made, path("y")), 0);
}

TEST_F(Overwriting, WhatIsNoRegularFile_MayBeWritten) {
  EXPECT_TRUE(check_free("/dev/null"));
  EXPECT_TRUE(check_free(folder_.path().string())) << "opening it says more";
  EXPECT_TRUE(check_free(path("new")));
}

}  // namespace
}  // namespace nodal::host
