// The structure of the tree: entries of the root, contents of every folder's README, file lengths, and banned
// texts.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>

#include "tree.h"

namespace nodal::tidy {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestFile = 400;  // lines; a longer file is usually two
// Longer files and their maximum lengths. Shorten them and remove them from here; never add one.
const std::map<std::string, std::size_t> kKnownLongFiles{{"tests/conformance/head_conformance.cpp", 412},
                                                         {"tests/unit/hal_sim/head_test.cpp", 438}};
constexpr std::size_t kLongestReadme = 60;  // lines; a module's README should fit a screen
constexpr std::size_t kLongestLine = 120;   // columns of a source, comments included

const TextFile* find_file(const std::string& path) {
  const auto& files = project_files();
  const auto it = std::ranges::find(files, path, &TextFile::path);
  return it == files.end() ? nullptr : &*it;
}

TEST(House, TopLevel_HoldsTheDesignsFoldersAndNothingElse) {
  const std::set<std::string> allowed{
      "CMakeLists.txt", "CMakePresets.json", "LICENSE",   "README.md", "protocol", "hal",
      "stitch",         "firmware",          "host_tool", "tests"};
  std::set<std::string> top;
  for (const std::string& path : project_paths()) top.insert(path.substr(0, path.find('/')));
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

std::vector<std::string> file_names_in(const std::string& text) {
  static const std::regex file_name(
      R"([A-Za-z0-9_./-]+\.(?:h|cpp|md|json|toml|proto|service|cmake|[1-8])(?![A-Za-z0-9_]))");
  std::vector<std::string> names;
  for (std::sregex_iterator it(text.begin(), text.end(), file_name), end; it != end; ++it) names.push_back(it->str());
  return names;
}

// If a table row's first cell looks like file names ("a.h, b.cpp", with or without backquotes), it names files.
std::vector<std::string> files_named_in(const std::string& line) {
  static const std::regex first_cell(R"(^\|([^|]*)\|)");
  std::smatch cell;
  return std::regex_search(line, cell, first_cell) ? file_names_in(cell[1]) : std::vector<std::string>{};
}

TEST(House, EveryReadmesFileTable_NamesFilesThatExist) {
  for (const TextFile& file : project_files()) {
    if (fs::path(file.path).filename() != "README.md") continue;
    const fs::path folder = fs::path(NODAL_SOURCE_DIR) / fs::path(file.path).parent_path();
    for (const std::string& line : file.lines) {
      for (const std::string& name : files_named_in(line)) {
        if (name.starts_with("NAME")) continue;  // a placeholder
        EXPECT_TRUE(fs::exists(folder / name) || fs::exists(fs::path(NODAL_SOURCE_DIR) / name))
            << file.path << " names " << name << ", which is not there";
      }
    }
  }
}

// A header's row also covers its source. A row may name files in any cell.
std::string missing_from_table(const TextFile& readme, const std::vector<std::string>& sources) {
  std::set<std::string> named;
  for (const std::string& line : readme.lines) {
    if (!line.starts_with('|')) continue;
    for (const std::string& name : file_names_in(line)) named.insert(name);
  }
  std::string missing;
  for (const std::string& source : sources) {
    const std::string header = fs::path(source).stem().string() + ".h";
    if (!named.contains(source) && !named.contains(header)) missing += " " + source;
  }
  return missing;
}

TEST(House, EverySourceFileOfAModule_IsInItsReadmesTable) {
  for (const std::string& folder : module_folders()) {
    const TextFile* readme = find_file(folder + "/README.md");
    if (readme == nullptr) continue;  // EveryModuleFolder_HasAReadmeThatSaysInOutNever reports it
    std::vector<std::string> sources;
    for (const TextFile& file : project_files()) {
      const fs::path path(file.path);
      if (is_source(file.path) && path.parent_path() == folder) sources.push_back(path.filename().string());
    }
    EXPECT_EQ(missing_from_table(*readme, sources), "") << "are in no row of " << readme->path;
  }
}

TEST(FileTable, SourceThatOnlyTheProseNames_IsMissing) {
  const TextFile readme{"a/README.md",
                        {"Read `rig.h` first.", "| `one.h` | one; its sums in `two.cpp` |", "| three | |"}};
  EXPECT_EQ(missing_from_table(readme, {"one.h", "one.cpp", "two.cpp"}), "");
  EXPECT_EQ(missing_from_table(readme, {"rig.h", "two.h", "three.cpp"}), " rig.h two.h three.cpp");
}

TEST(FileTable, CellsOfManyShapes_GiveTheFilesInThem) {
  EXPECT_EQ(files_named_in("| `blend.h` | the kernels |"), std::vector<std::string>{"blend.h"});
  EXPECT_EQ(files_named_in("| pts.h, pts.cpp | PTGui |"), (std::vector<std::string>{"pts.h", "pts.cpp"}));
  EXPECT_TRUE(files_named_in("| word | meaning of a.h |").empty());
  EXPECT_TRUE(files_named_in("see blend.h").empty());
}

// For `Class::function` and `namespace::function` in a README: the second word is a function or type of the first.
std::vector<std::string> functions_named_in(const std::string& line) {
  static const std::regex function(R"(`([a-z_]+::)*([A-Z][A-Za-z]*::)?([a-z_]{3,})`)");
  std::vector<std::string> names;
  for (std::sregex_iterator it(line.begin(), line.end(), function), end; it != end; ++it) {
    if ((*it)[1].matched || (*it)[2].matched) names.push_back((*it)[2].str() + (*it)[3].str());
  }
  return names;
}

TEST(House, FunctionsThatReadmesTrace_AreThere) {
  std::set<std::string> words;
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    static const std::regex word("[A-Za-z_]+");
    for (const std::string& line : file.lines) {
      for (std::sregex_iterator it(line.begin(), line.end(), word), end; it != end; ++it) words.insert(it->str());
    }
  }
  std::size_t checked = 0;
  for (const TextFile& file : project_files()) {
    // CONTRIBUTING.md holds the ways of a frame, a calibration and a command.
    if (fs::path(file.path).filename() != "README.md" && file.path != ".github/CONTRIBUTING.md") continue;
    for (const std::string& line : file.lines) {
      for (const std::string& name : functions_named_in(line)) {
        const std::size_t colons = name.find("::");
        const bool in_class = colons != std::string::npos;
        EXPECT_TRUE(words.contains(in_class ? name.substr(colons + 2) : name) &&
                    (!in_class || words.contains(name.substr(0, colons))))
            << file.path << " names " << name << ", which no source has";
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 40u);
}

/// Characters of a line in UTF-8.
std::size_t columns_of(const std::string& line) {
  return static_cast<std::size_t>(
      std::ranges::count_if(line, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

TEST(Columns, AreCountedByCharacterAndNotByByte) {
  EXPECT_EQ(columns_of("// 250µs, 180°"), 14u);
  EXPECT_EQ(columns_of(""), 0u);
}

TEST(House, NoSourceFile_IsTooLong) {
  for (const TextFile& file : project_files()) {
    if (!is_source(file.path)) continue;
    const auto known = kKnownLongFiles.find(file.path);
    const std::size_t longest = known == kKnownLongFiles.end() ? kLongestFile : known->second;
    EXPECT_LE(file.lines.size(), longest) << file.path << " is usually two files";
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      EXPECT_LE(columns_of(file.lines[i]), kLongestLine) << file.path << ":" << i + 1;
      EXPECT_EQ(file.lines[i].find('\t'), std::string::npos) << file.path << ":" << i + 1 << " has a tab";
    }
  }
}

TEST(House, KnownLongFiles_AreStillThereAndTooLong) {
  for (const auto& [path, lines] : kKnownLongFiles) {
    const TextFile* file = find_file(path);
    ASSERT_NE(file, nullptr) << path << " is gone: take it out of kKnownLongFiles";
    EXPECT_GT(file->lines.size(), kLongestFile) << path << " is short enough: take it out of kKnownLongFiles";
  }
}

TEST(House, EveryHeader_IsIncludedOnlyOnce) {
  for (const TextFile& file : project_files()) {
    if (!file.path.ends_with(".h")) continue;
    EXPECT_TRUE(std::ranges::find(file.lines, "#pragma once") != file.lines.end())
        << file.path << " has no #pragma once";
  }
}

// Split in halves, so that this file does not match itself.
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

// The blend runs on boards without a fast floating-point unit, and must give the same bytes everywhere: no floating
// type may appear in it, not even for a constant.
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
