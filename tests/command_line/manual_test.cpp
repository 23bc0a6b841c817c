// nodald's manual page and `nodald --help` name the same options. (nodal's is compared command by command in
// tests/unit/host_tool.)
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>

#include "tests/support/process.h"

namespace nodal::command_line {
namespace {

std::set<std::string> options_in(const std::string& text) {
  std::set<std::string> options;
  static const std::regex option(R"((^|[\s,\["])(--[a-z][a-z-]+|-[A-Za-z](?=[, ])))");
  for (std::sregex_iterator it(text.begin(), text.end(), option), end; it != end; ++it) options.insert((*it)[2]);
  return options;
}

TEST(NodaldExplain, AKey_PrintsWhatRigMdSaysAboutIt) {
  const test::Finished known = test::Process({NODAL_BIN_DIR "/nodald", "--explain", "takes.mode"}).wait();
  EXPECT_EQ(known.code, 0) << known.err;
  EXPECT_TRUE(known.out.starts_with("takes.mode\n\nHow the heads' pictures are stored.\n")) << known.out;
  EXPECT_NE(known.out.find("Default: `driver`."), std::string::npos) << known.out;
  const test::Finished unknown = test::Process({NODAL_BIN_DIR "/nodald", "--explain", "takes.mod"}).wait();
  EXPECT_EQ(unknown.code, 2);
  EXPECT_EQ(unknown.out, "");
  EXPECT_EQ(unknown.err, "nodald: rig.toml has no key 'takes.mod'; did you mean 'takes.mode'?\n");
}

TEST(NodaldManual, OptionsInItAndInHelp_AreTheSame) {
  const test::Finished help = test::Process({NODAL_BIN_DIR "/nodald", "--help"}).wait();
  ASSERT_EQ(help.code, 0);
  std::ifstream file(NODAL_SOURCE_DIR "/firmware/daemon/nodald.8");
  std::string page{std::istreambuf_iterator<char>(file), {}};
  page = std::regex_replace(page, std::regex(R"(\\-)"), "-");
  const std::size_t from = page.find(".SH OPTIONS");
  const std::size_t to = page.find(".SH SIGNALS");
  ASSERT_NE(to, std::string::npos);
  // Takes only the lines of --help that define options, and the lines of the page that name them.
  std::string defined;
  static const std::regex definition(R"(\n  (-[^ ]*))");
  for (std::sregex_iterator it(help.out.begin(), help.out.end(), definition), end; it != end; ++it) {
    defined += " " + std::regex_replace(std::string((*it)[1]), std::regex(","), " , ") + " ";
  }
  std::string named;
  static const std::regex heading(R"(\.TP\n(\.B[^\n]*))");
  const std::string section = page.substr(from, to - from);
  for (std::sregex_iterator it(section.begin(), section.end(), heading), end; it != end; ++it) {
    named += std::string((*it)[1]) + " ";
  }
  EXPECT_GE(options_in(defined).size(), 8U) << defined;
  EXPECT_EQ(options_in(named), options_in(defined));
}

}  // namespace
}  // namespace nodal::command_line
