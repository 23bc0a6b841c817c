// What only a person at a terminal sees: a screen that is too small, a question before something is deleted.
#include "tests/support/terminal.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "rig_process.h"

namespace nodal::command_line {
namespace {

class AtATerminal : public RigTest {
 protected:
  test::Shown at_terminal(Words words, const test::Terminal& like) const {
    words.insert(words.begin(), NODAL_BIN_DIR "/nodal");
    return test::run_in_terminal(words, environment_, like);
  }
};

TEST_F(AtATerminal, ASmallScreen_ShowsTheStateFirstAndSaysWhatIsCut) {
  start_nodald();
  const test::Shown shown = at_terminal({"status", "--watch", "--count", "1"}, {.rows = 8});
  ASSERT_EQ(shown.code, 0) << shown.text;
  EXPECT_EQ(std::ranges::count(shown.text, '\n'), 7) << "the cursor stands in the eighth line:\n" << shown.text;
  EXPECT_LT(shown.text.find(" at unix:"), shown.text.find('\n')) << "the state is in the first line";
  EXPECT_NE(shown.text.find("more lines in a higher window"), std::string::npos) << shown.text;
  const test::Shown whole = at_terminal({"status", "--watch", "--count", "1"}, {.rows = 60});
  EXPECT_EQ(whole.text.find("more lines"), std::string::npos) << whole.text;
  EXPECT_NE(whole.text.find("memory"), std::string::npos) << whole.text;
}

TEST_F(AtATerminal, TakeDelete_AsksAndDeletesOnlyOnYes) {
  start_rig_with_takes();
  ASSERT_EQ(nodal({"take", "still"}).code, 0);
  const auto takes = [&] { return nodal_json({"take", "list"}).at(0)["takes"].size(); };
  const test::Shown no = at_terminal({"take", "delete", "1"}, {.typed = "n\n"});
  EXPECT_NE(no.code, 0);
  EXPECT_NE(no.text.find("Delete it? [y/N]"), std::string::npos) << no.text;
  EXPECT_EQ(takes(), 1U);
  EXPECT_NE(at_terminal({"take", "delete", "1"}, {.typed = "\n"}).code, 0) << "the answer that is there is no";
  EXPECT_EQ(takes(), 1U);
  EXPECT_EQ(at_terminal({"take", "delete", "1"}, {.typed = "y\n"}).code, 0);
  EXPECT_EQ(takes(), 0U);
}

TEST_F(AtATerminal, TakeDelete_DoesNotAskAScriptOrWithYes) {
  start_rig_with_takes();
  for (int n = 0; n < 2; ++n) ASSERT_EQ(nodal({"take", "still"}).code, 0);
  EXPECT_EQ(nodal({"take", "delete", "1"}).code, 0) << "nobody is there to answer";
  const test::Shown sure = at_terminal({"take", "delete", "2", "--yes"}, {});
  EXPECT_EQ(sure.code, 0) << sure.text;
  EXPECT_EQ(sure.text.find("[y/N]"), std::string::npos) << sure.text;
}

TEST_F(AtATerminal, NodaldTellsOfAWordThatItDoesNotKnow_AsNodalDoes) {
  const Finished wrong = Process({NODAL_BIN_DIR "/nodald", "--cofig", "x"}).wait();
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("nodald: `nodald` has no option '--cofig'; did you mean '--config'?"), std::string::npos)
      << wrong.err;
  EXPECT_NE(wrong.err.find("Run `nodald --help`."), std::string::npos) << wrong.err;
  const Finished help = Process({NODAL_BIN_DIR "/nodald", "--help"}).wait();
  EXPECT_EQ(help.out.find("Excludes:"), std::string::npos) << help.out;
  EXPECT_EQ(help.out.find(" in ["), std::string::npos) << help.out;
}

TEST_F(AtATerminal, NodaldTakesARigTomlWithoutAnOption) {
  const Finished checked = Process({NODAL_BIN_DIR "/nodald", path("rig.toml"), "--check"}).wait();
  EXPECT_EQ(checked.code, 0) << checked.err;
}

}  // namespace
}  // namespace nodal::command_line
