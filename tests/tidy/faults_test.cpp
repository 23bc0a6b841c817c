// tests/faults/faults.txt against the tree: the replaced texts exist, and the claims of tests/README.md are tested.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tree.h"

namespace nodal::tidy {
namespace {

constexpr const char* kList = "tests/faults/faults.txt";

const TextFile* find_file(std::string_view path) {
  const auto& files = project_files();
  const auto found = std::ranges::find(files, path, &TextFile::path);
  return found == files.end() ? nullptr : &*found;
}

const TextFile& list() {
  static const TextFile none;
  const TextFile* const file = find_file(kList);
  return file ? *file : none;
}

/// The values of all lines "KEY value".
std::vector<std::string> values(std::string_view key) {
  std::vector<std::string> all;
  const std::string start = std::string(key) + " ";
  for (const std::string& line : list().lines) {
    if (line.starts_with(start)) all.push_back(line.substr(start.size()));
  }
  return all;
}

std::size_t times(std::string_view text, const TextFile& file) {
  std::size_t count = 0;
  for (const std::string& line : file.lines) {
    for (std::size_t at = 0; (at = line.find(text, at)) != std::string::npos; at += text.size()) ++count;
  }
  return count;
}

TEST(Faults, EachReplacedText_IsInItsFileExactlyOnce) {
  const std::vector<std::string> files = values("file"), texts = values("from");
  ASSERT_EQ(files.size(), texts.size());
  ASSERT_GE(files.size(), 40U);
  for (std::size_t i = 0; i < files.size(); ++i) {
    const TextFile* const file = find_file(files[i]);
    if (!file) ADD_FAILURE() << kList << " names " << files[i] << ", which is not there";
    else EXPECT_EQ(times(texts[i], *file), 1U) << files[i] << " does not hold this exactly once: " << texts[i];
  }
}

TEST(Faults, OfEachFinding_ThereIsOne) {
  const std::vector<std::string> numbers = values("finding");
  for (int number = 1; number <= 11; ++number) {
    EXPECT_EQ(std::ranges::count(numbers, std::to_string(number)), 1) << "finding " << number;
  }
}

TEST(Faults, TheTestsThatTheReadmeNames_AreThoseThatMustFail) {
  std::set<std::string> named, tried;
  static const std::regex test(R"(`([A-Z]\w*\.[A-Z]\w*)`)");
  const TextFile* const readme = find_file("tests/README.md");
  ASSERT_NE(readme, nullptr);
  for (const std::string& line : readme->lines) {
    for (std::sregex_iterator it(line.begin(), line.end(), test), end; it != end; ++it) named.insert((*it)[1]);
  }
  for (const std::string& value : values("test")) tried.insert(value.substr(value.find(' ') + 1));
  EXPECT_EQ(named, tried);
}

}  // namespace
}  // namespace nodal::tidy
