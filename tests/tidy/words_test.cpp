// The words of comments: each is understood without the line that it stands beside.
#include <gtest/gtest.h>

#include <cctype>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "functions.h"
#include "tree.h"

namespace nodal::tidy {
namespace {

/// Where the comment of a line begins; npos without one. Strings and character literals that end on the line are code.
std::size_t comment_of(const std::string& line) {
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (quote != 0) {
      if (line[i] == '\\') ++i;
      else if (line[i] == quote) quote = 0;
    } else if (line[i] == '"' ||
               (line[i] == '\'' && (i == 0 || std::isalnum(static_cast<unsigned char>(line[i - 1])) == 0))) {
      quote = line[i];
    } else if (line.compare(i, 2, "//") == 0) {
      return i;
    }
  }
  return std::string::npos;
}

/// Numbers, from 1, of the lines whose comment begins with "of", "in", "that" or "for": "///< of the newest set" leaves
/// open what of it. A line that continues the comment of the line before, in the same column, may begin with any word.
std::vector<std::size_t> fragments_in(const std::vector<std::string>& lines) {
  static const std::regex fragment(R"(^//+<? ?(of|in|that|for)\b.*)");
  std::vector<std::size_t> found;
  std::size_t before = std::string::npos;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::size_t at = comment_of(lines[i]);
    if (at != std::string::npos) {
      const bool continues =
          at == before && lines[i].find_first_not_of(' ') == at && !lines[i].substr(at).starts_with("///<");
      if (!continues && std::regex_match(lines[i].substr(at), fragment)) found.push_back(i + 1);
    }
    before = at;
  }
  return found;
}

TEST(Words, Comments_BeginWithWhatTheySpeakOf) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) && !file.path.ends_with(".proto")) continue;
    for (const std::size_t line : fragments_in(file.lines)) {
      ADD_FAILURE() << file.path << ":" << line << ": say what the thing is: \"length of ...\", \"used for ...\"";
    }
  }
}

TEST(Words, LimitsAreNamedMaxOrMin) {
  static const std::regex other(R"(\bk(Most|Least)([A-Z0-9]\w*)?\b)");
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) || file.path == "tests/tidy/words_test.cpp") continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      EXPECT_FALSE(std::regex_search(file.lines[i], other)) << file.path << ":" << i + 1 << ": kMax..., kMin...";
    }
  }
}

/// The file without comments and literals, raw ones included.
std::string names_in(const TextFile& file) {
  TextFile rest{file.path, {}};
  bool raw = false;
  for (std::string line : file.lines) {
    const std::size_t end = raw ? line.find(")\"") : 0;
    line = end == std::string::npos ? "" : line.substr(end);
    const std::size_t begin = line.find("R\"(");
    if (begin != std::string::npos) {
      raw = line.find(")\"", begin) == std::string::npos;
      line = line.substr(0, begin);
    } else if (end != std::string::npos) {
      raw = false;
    }
    rest.lines.push_back(line);
  }
  return brackets_of(rest);
}

TEST(Words, NamesAreNounsOrVerbsOfTheField) {
  static const std::regex other(R"(\b(there|told|began|works|obeys?)\b)");
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    std::istringstream code(names_in(file));
    std::size_t number = 0;
    for (std::string line; std::getline(code, line);) {
      ++number;
      std::smatch name;
      EXPECT_FALSE(std::regex_search(line, name, other))
          << file.path << ":" << number << ": '" << name.str() << "' does not say what it names";
    }
  }
}

TEST(Fragments, CommentsOfManyShapes_OnlyThoseThatBeginWithAFragmentAreFound) {
  EXPECT_EQ(fragments_in({"int a;  ///< of the set", "int b;  // in px", "int c;  ///< formats that it has", "// for b",
                          "int d;"}),
            (std::vector<std::size_t>{1, 2, 4}));
  EXPECT_EQ(fragments_in({"/// The sum", "/// of both.", "int a;  // the sum", "        // of both"}),
            std::vector<std::size_t>{});
  EXPECT_EQ(fragments_in({"const char* a = \"x // of b\";", "char c = '\"';  // that quote",
                          "f(1'000);  // for a while", "int a;  // intact"}),
            (std::vector<std::size_t>{2, 3}));
}

}  // namespace
}  // namespace nodal::tidy
