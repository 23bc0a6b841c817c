// protocol/LIMITS.md and tests/README.md against the tree: named items exist, and every limit in a header is listed.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tree.h"

namespace nodal::tidy {
namespace {

constexpr const char* kPage = "protocol/LIMITS.md";

// Counts that no peer can affect, or parts of a listed limit.
const std::set<std::string> kNoLimits{"kMaxPieceBytes",     // a part of kMaxBulkBytes, without its header
                                      "kMaxPinholeAngle",   // an angle
                                      "kMaxPatience",       // windows that shedding waits
                                      "kMaxDocumentBytes",  // the disk's own documents, checked as they are read
                                      "kMaxFailed"};        // starts of nodald in a row

struct Row {
  std::string what, limit, memory, test;
};

std::string trimmed(const std::string& cell) {
  const std::size_t begin = cell.find_first_not_of(' '), end = cell.find_last_not_of(' ');
  return begin == std::string::npos ? "" : cell.substr(begin, end - begin + 1);
}

std::vector<Row> rows() {
  std::vector<Row> all;
  for (const TextFile& file : project_files()) {
    if (file.path != kPage) continue;
    for (const std::string& line : file.lines) {
      static const std::regex row(R"(^\|([^|]*)\|([^|]*)\|([^|]*)\|[^|]*\|([^|]*)\|$)");
      std::smatch cells;
      if (!std::regex_match(line, cells, row) || cells[1] == "---" || cells[1] == " what ") continue;
      all.push_back({trimmed(cells[1]), cells[2], trimmed(cells[3]), cells[4]});
    }
  }
  return all;
}

/// The texts matched by the only group of `pattern` in `text`.
std::vector<std::string> found(const std::string& text, const std::regex& pattern) {
  std::vector<std::string> all;
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it) all.push_back((*it)[1]);
  return all;
}

/// `kConstant` or `Class::kConstant` in backquotes; returned without the class.
std::vector<std::string> constants_in(const std::string& cell) {
  static const std::regex constant(R"(`(?:\w+::)?(k[A-Z]\w*)`)");
  return found(cell, constant);
}

std::set<std::string> constants_of(const std::string& text) {
  static const std::regex defined(R"(\bconstexpr\b[^=;(]*?\b(k[A-Z]\w*)\s*=)");
  const std::vector<std::string> all = found(text, defined);
  return {all.begin(), all.end()};
}

std::string whole(const TextFile& file) {
  std::string text;
  for (const std::string& line : file.lines) text += line + "\n";
  return text;
}

std::string whole_page(const std::string& path) {
  for (const TextFile& file : project_files()) {
    if (file.path == path) return whole(file);
  }
  return "";
}

TEST(Limits, EveryConstantNamed_IsDefinedInTheCode) {
  std::set<std::string> defined;
  for (const TextFile& file : project_files()) {
    if (is_source(file.path) && !file.path.starts_with("tests/")) defined.merge(constants_of(whole(file)));
  }
  ASSERT_GE(rows().size(), 30u);
  std::size_t named = 0;
  for (const Row& row : rows()) {
    for (const std::string& name : constants_in(row.limit)) {
      ++named;
      EXPECT_TRUE(defined.contains(name)) << kPage << " names " << name << ", which nothing defines";
    }
  }
  EXPECT_GE(named, 40u);
}

TEST(Limits, EveryTestNamed_Exists) {
  std::set<std::string> tests;
  static const std::regex declared(R"((?:TEST(?:_F|_P)?|RC_GTEST_PROP)\(\s*(\w+\s*,\s*\w+)\s*[,)])");
  for (const TextFile& file : project_files()) {
    if (!file.path.starts_with("tests/") || !file.path.ends_with(".cpp")) continue;
    for (std::string name : found(whole(file), declared)) {
      std::erase_if(name, [](unsigned char c) { return std::isspace(c) != 0; });
      tests.insert(name.replace(name.find(','), 1, "."));
    }
  }
  static const std::regex named(R"(`([A-Z]\w*\.[A-Z]\w*)`)");
  for (const Row& row : rows()) EXPECT_FALSE(found(row.test, named).empty()) << "no test in: " << row.limit;
  for (const char* page : {kPage, "tests/README.md"}) {
    const std::vector<std::string> names = found(whole_page(page), named);
    EXPECT_GE(names.size(), 30u) << page;
    for (const std::string& name : names) EXPECT_TRUE(tests.contains(name)) << page << " names the test " << name;
  }
}

TEST(Limits, EveryMaximumOfAHeader_IsOnThePage) {
  std::set<std::string> listed = kNoLimits;
  for (const Row& row : rows()) {
    for (const std::string& name : constants_in(row.limit)) listed.insert(name);
  }
  for (const TextFile& file : project_files()) {
    const bool ours = file.path.starts_with("protocol/") || file.path.starts_with("firmware/");
    if (!ours || !file.path.ends_with(".h") || file.path.starts_with("protocol/base/")) continue;
    for (const std::string& name : constants_of(whole(file))) {
      if (!name.starts_with("kMax")) continue;
      EXPECT_TRUE(listed.contains(name)) << file.path << ": " << name << " is not in " << kPage;
    }
  }
}

/// All test sources of a folder in one text.
std::string tests_below(const std::string& folder) {
  std::string text;
  for (const TextFile& file : project_files()) {
    if (file.path.starts_with(folder) && file.path.ends_with(".cpp")) text += whole(file);
  }
  return text;
}

TEST(Limits, EveryRow_SaysWhatMemoryItCostsAndATestHoldsItsFigure) {
  static const std::regex figure(R"(\d+ (?:bytes|KiB|MiB|raymaps|sets)\b[^()]*\((heap|sizes|addresses)\))");
  static const std::regex part("part of \"(.+)\"");
  const std::set<std::string> others{"none", "what is free", "`[takes] buffer_mb` of rig.toml"};
  const std::string limits = tests_below("tests/limits/"), all_tests = tests_below("tests/");
  std::map<std::string, std::string> memory;
  for (const Row& row : rows()) {
    EXPECT_TRUE(memory.emplace(row.what, row.memory).second) << kPage << " has two rows '" << row.what << "'";
  }
  std::size_t figures = 0;
  for (const auto& [what, cell] : memory) {
    std::smatch found;
    if (std::regex_match(cell, found, figure)) {
      ++figures;
      // A test that reads the figure names the row as the page does.
      const std::string& tests = found[1] == "addresses" ? all_tests : limits;
      EXPECT_NE(tests.find("\"" + what + "\""), std::string::npos) << "no test holds the memory of '" << what << "'";
    } else if (std::regex_match(cell, found, part)) {
      const auto whole_row = memory.find(found[1]);
      ASSERT_NE(whole_row, memory.end()) << kPage << ": '" << what << "' is part of a row that is not there";
      EXPECT_TRUE(std::regex_match(whole_row->second, figure))
          << kPage << ": '" << what << "' is part of what has no figure";
    } else {
      EXPECT_TRUE(others.contains(cell)) << kPage << ": '" << what << "' does not say what memory it costs: " << cell;
    }
  }
  EXPECT_GE(figures, 40u);
}

}  // namespace
}  // namespace nodal::tidy
