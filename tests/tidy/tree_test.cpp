// The shape of the house: what lies at the top, what every folder's README must say, how long a file may be,
// and what nobody may write.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>

#include "tree.h"

namespace nodal::tidy {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestFile = 500;    // lines; past 400 a file is usually two
constexpr std::size_t kLongestReadme = 60;   // lines; a module's README fits a screen
constexpr std::size_t kLongestLine = 160;    // columns of C++; 120 is better

const TextFile* find_file(const std::string& path) {
  const auto& files = project_files();
  const auto it = std::ranges::find(files, path, &TextFile::path);
  return it == files.end() ? nullptr : &*it;
}

TEST(House, TopLevel_HoldsTheDesignsFoldersAndNothingElse) {
  const std::set<std::string> allowed{"CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md", "protocol",
                                      "hal", "stitch", "firmware", "host_tool", "tests"};
  std::set<std::string> top;
  for (const TextFile& file : project_files()) top.insert(file.path.substr(0, file.path.find('/')));
  for (const std::string& name : top) {
    EXPECT_TRUE(name.starts_with('.') || allowed.contains(name)) << name << " does not belong at the top level";
  }
  for (const std::string& name : allowed) EXPECT_TRUE(top.contains(name)) << name << " is missing";
}

TEST(House, EveryModuleFolder_HasAReadmeThatSaysInOutNever) {
  ASSERT_GE(module_folders().size(), 2u);
  for (const std::string& folder : module_folders()) {
    const TextFile* readme = find_file(folder + "/README.md");
    if (readme == nullptr) {
      ADD_FAILURE() << folder << " has no README.md";
      continue;
    }
    EXPECT_LE(readme->lines.size(), kLongestReadme) << readme->path << " does not fit a screen";
    std::string text;
    for (const std::string& line : readme->lines) text += line + "\n";
    for (const char* word : {"In:", "Out:", "Never:"}) {
      EXPECT_NE(text.find(word), std::string::npos) << readme->path << " does not say " << word;
    }
  }
}

// A table row's first cell that looks like files ("a.h, b.cpp", with or without backquotes) names files.
std::vector<std::string> files_named_in(const std::string& line) {
  std::vector<std::string> names;
  static const std::regex first_cell(R"(^\|([^|]*)\|)");
  static const std::regex file_name(
      R"([A-Za-z0-9_./-]+\.(?:h|cpp|md|json|toml|proto|service|cmake|[1-8])(?![A-Za-z0-9_]))");
  std::smatch cell;
  if (!std::regex_search(line, cell, first_cell)) return names;
  const std::string text = cell[1];
  for (std::sregex_iterator it(text.begin(), text.end(), file_name), end; it != end; ++it) names.push_back(it->str());
  return names;
}

TEST(House, EveryReadmesFileTable_NamesFilesThatExist) {
  for (const TextFile& file : project_files()) {
    if (fs::path(file.path).filename() != "README.md") continue;
    const fs::path folder = fs::path(NODAL_SOURCE_DIR) / fs::path(file.path).parent_path();
    for (const std::string& line : file.lines) {
      for (const std::string& name : files_named_in(line)) {
        if (name.starts_with("NAME")) continue;  // stands for any
        EXPECT_TRUE(fs::exists(folder / name) || fs::exists(fs::path(NODAL_SOURCE_DIR) / name))
            << file.path << " names " << name << ", which is not there";
      }
    }
  }
}

TEST(House, EverySourceFileOfAModule_IsInItsReadme) {
  for (const std::string& folder : module_folders()) {
    const TextFile* readme = find_file(folder + "/README.md");
    if (readme == nullptr) continue;  // told by the test above
    std::string text;
    for (const std::string& line : readme->lines) text += line + "\n";
    for (const TextFile& file : project_files()) {
      const fs::path path(file.path);
      if (!is_source(file.path) || path.parent_path() != folder) continue;
      EXPECT_NE(text.find(path.stem().string()), std::string::npos)
          << folder << "/README.md does not mention " << path.filename().string();
    }
  }
}

TEST(FileTable, CellsOfManyShapes_GiveTheFilesInThem) {
  EXPECT_EQ(files_named_in("| `blend.h` | the kernels |"), std::vector<std::string>{"blend.h"});
  EXPECT_EQ(files_named_in("| pts.h, pts.cpp | PTGui |"), (std::vector<std::string>{"pts.h", "pts.cpp"}));
  EXPECT_TRUE(files_named_in("| word | meaning of a.h |").empty());
  EXPECT_TRUE(files_named_in("see blend.h").empty());
}

TEST(House, NoSourceFile_IsTooLong) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    EXPECT_LE(file.lines.size(), kLongestFile) << file.path << " is usually two files";
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      EXPECT_LE(file.lines[i].size(), kLongestLine) << file.path << ":" << i + 1;
      EXPECT_EQ(file.lines[i].find('\t'), std::string::npos) << file.path << ":" << i + 1 << " has a tab";
    }
  }
}

TEST(House, EveryHeader_IsIncludedOnlyOnce) {
  for (const TextFile& file : project_files()) {
    if (!file.path.ends_with(".h")) continue;
    EXPECT_TRUE(std::ranges::find(file.lines, "#pragma once") != file.lines.end())
        << file.path << " has no #pragma once";
  }
}

// Written in halves, so that this file does not offend.
struct Banned {
  std::string word;
  std::string instead;
};
const std::vector<Banned>& banned_words() {
  static const std::vector<Banned> words{
      {std::string("TO") + "DO", "do it, or open an issue"},
      {std::string("FIX") + "ME", "fix it, or open an issue"},
      {std::string("HA") + "CK", "say what it works around and why"},
      {std::string("/wo") + "rk/", "a path of somebody's machine"},
      {std::string("/ro") + "ot/", "a path of somebody's machine"},
      {std::string("/ho") + "me/", "a path of somebody's machine"},
      {std::string("far") + "m-", "a name of somebody's machine"},
  };
  return words;
}

TEST(House, NoFile_SaysWhatNobodyMayWrite) {
  for (const TextFile& file : project_files()) {
    if (file.path == "LICENSE") continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      for (const Banned& banned : banned_words()) {
        EXPECT_EQ(file.lines[i].find(banned.word), std::string::npos)
            << file.path << ":" << i + 1 << " says \"" << banned.word << "\": " << banned.instead;
      }
    }
  }
}

// The blend runs on boards without a floating-point unit worth the name, and must give the same bytes
// everywhere: no floating type may appear in it, not even for a constant.
TEST(House, TheBlend_NamesNoFloatingType) {
  static const std::regex floating(R"(\b(float|double)\b)");
  int files = 0;
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path) || !file.path.starts_with("stitch/blend/")) continue;
    ++files;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      const std::string code = file.lines[i].substr(0, file.lines[i].find("//"));
      EXPECT_FALSE(std::regex_search(code, floating)) << file.path << ":" << i + 1 << ": " << code;
    }
  }
  EXPECT_GT(files, 0);
}

}  // namespace
}  // namespace nodal::tidy
