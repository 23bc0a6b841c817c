// No function exists twice.
#include "functions.h"

#include <gtest/gtest.h>

namespace nodal::tidy {
namespace {

// Shorter bodies are equal by chance (a getter, a sum); longer ones are copies.
constexpr std::size_t kLinesAlike = 4;
constexpr std::size_t kLinesRenamed = 6;

TEST(Functions, NoTwo_HaveTheSameBody) {
  for (const std::string& repeated : repeated_functions(project_files(), kLinesAlike, kLinesRenamed)) {
    ADD_FAILURE() << repeated;
  }
}

const TextFile kFirst{"a.cpp",
                      {"int sum(const Numbers& all) const {", "  int total = 0;  // so far", "",
                       "  for (int n : all) {", "    if (n > 7) total += n;", "  }", "  return total;", "}"}};

TEST(Functions, AFunctionAndItsStatements_AreToldApart) {
  const std::vector<Function> functions = functions_in(kFirst);
  ASSERT_EQ(functions.size(), 1u);
  EXPECT_EQ(functions[0].line, 1u);
  EXPECT_EQ(functions[0].lines, 5u);
  EXPECT_EQ(functions[0].body, "{ int total = 0; for (int n : all) { if (n > 7) total += n; } return total; }");
}

TEST(Functions, BracesInTextAndComments_DoNotCount) {
  const TextFile file{"b.cpp", {"void tell() {", "  say(\"}{{\\\"{\", '{', 1'000);  // {", "  /* { */ end();", "}"}};
  const std::vector<Function> functions = functions_in(file);
  ASSERT_EQ(functions.size(), 1u);
  EXPECT_EQ(functions[0].lines, 2u);
}

TEST(Functions, ACopyInOtherLines_IsFound) {
  const TextFile copy{
      "b.cpp",
      {"long other(Numbers all)", "{", "  int total = 0;", "  for (int n : all) { if (n > 7) total += n; }",
       "  // remark", "  return", "      total;", "}"}};
  EXPECT_EQ(repeated_functions({kFirst, copy}, 4, 99),
            std::vector<std::string>{"b.cpp:2 has the same body as a.cpp:1"});
  EXPECT_TRUE(repeated_functions({kFirst, copy}, 6, 99).empty());
}

TEST(Functions, ACopyUnderOtherNames_IsFoundAndAnotherNumberIsNoCopy) {
  TextFile renamed{"b.cpp", kFirst.lines};
  for (std::string& line : renamed.lines) {
    for (std::size_t at = line.find("total"); at != std::string::npos; at = line.find("total"))
      line.replace(at, 5, "whole");
  }
  EXPECT_EQ(repeated_functions({kFirst, renamed}, 4, 5),
            std::vector<std::string>{"b.cpp:1 has, but for names, the body of a.cpp:1"});
  renamed.lines[4].replace(renamed.lines[4].find('7'), 1, "8");
  EXPECT_TRUE(repeated_functions({kFirst, renamed}, 4, 5).empty());
}

}  // namespace
}  // namespace nodal::tidy
