#include "include_rules.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "tree.h"

namespace nodal::tidy {
namespace {

bool covers(std::string_view pattern, std::string_view path) {
  return pattern.ends_with('/') ? path.starts_with(pattern) : path == pattern;
}

std::string folder_of(std::string_view file) {
  const std::size_t slash = file.rfind('/');
  return std::string(file.substr(0, slash == std::string_view::npos ? 0 : slash));
}

std::string join(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

/// Depth first; `path` holds the folders of the current path, `done` those that are part of no cycle.
bool finds_cycle(const IncludeTable& table, const std::string& folder, std::set<std::string>& done,
                 std::vector<std::string>& path) {
  if (done.contains(folder)) return false;
  const auto met = std::ranges::find(path, folder);
  if (met != path.end()) {
    path.erase(path.begin(), met);
    path.push_back(folder);
    return true;
  }
  path.push_back(folder);
  if (const auto line = table.find(folder); line != table.end()) {
    for (const std::string& seen : line->second) {
      if (finds_cycle(table, seen.ends_with(".h") ? folder_of(seen) : seen, done, path)) return true;
    }
  }
  path.pop_back();
  done.insert(folder);
  return false;
}

}  // namespace

IncludeTable parse_include_table(const std::vector<std::string>& lines) {
  IncludeTable table;
  std::vector<std::string>* row = nullptr;
  for (const std::string& line : lines) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    if (!line.empty() && line.front() != ' ' && line.front() != '\t') {
      std::string folder;
      std::getline(words, folder, ':');
      row = &table[folder];
    }
    for (std::string word; row != nullptr && words >> word;) row->push_back(word);
  }
  return table;
}

const IncludeTable& include_table() {
  static const IncludeTable table = [] {
    const auto& files = project_files();
    const auto file = std::ranges::find(files, ".cmake/includes.txt", &TextFile::path);
    return file == files.end() ? IncludeTable{} : parse_include_table(file->lines);
  }();
  return table;
}

std::vector<std::string> cycle_in(const IncludeTable& table) {
  std::set<std::string> done;
  std::vector<std::string> path;
  for (const auto& row : table) {
    if (finds_cycle(table, row.first, done, path)) return path;
  }
  return {};
}

const std::vector<LibraryRule>& library_rules() {
  static const std::vector<std::string_view> stepped{"stitch/", "firmware/"};
  static const std::vector<LibraryRule> rules{
      {"Eigen/", {"stitch/", "tests/"}, {"stitch/blend/"}, "double precision stays off the rig's hot path"},
      {"linux/videodev2.h", {"hal/linux/", "tests/"}, {}, "a camera is a HeadPort to everybody else"},
      {"libusb-1.0/", {"hal/linux/", "tests/"}, {}, "USB is a LinkPort to everybody else"},
      {"dc1394/", {"hal/linux/", "tests/"}, {}, "a camera is a HeadPort to everybody else"},
      {"gpiod.h", {"hal/linux/", "tests/"}, {}, "a pin is a PinPort to everybody else"},
      {"cmath", {""}, {"stitch/blend/"}, "the blend is integer only"},
      {"thread",
       {"firmware/daemon/", "hal/", "host_tool/", "stitch/parallel/", "tests/"},
       {},
       "stages are stepped: they own no thread (stitch/parallel is used on hosts only)"},
      {"mutex", {"firmware/daemon/", "hal/", "host_tool/", "tests/"}, {}, "stages are stepped: they wait on no lock"},
      {"condition_variable",
       {"firmware/daemon/", "hal/", "host_tool/", "tests/"},
       {},
       "stages are stepped: they wait for nothing"},
      {"fstream", {""}, {"firmware/", "stitch/"}, "files are the DiskPort's"},
      {"sys/socket.h", {""}, {"firmware/", "stitch/", "protocol/"}, "sockets are the LinkPort's"},
      {"fcntl.h",
       {""},
       {"stitch/", "protocol/base/", "protocol/take/", "protocol/toml/"},
       "files are opened by protocol/files"},
  };
  return rules;
}

std::optional<Include> parse_include(std::string_view line) {
  const auto skip_blanks = [&line] { line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size())); };
  skip_blanks();
  if (!line.starts_with('#')) return std::nullopt;
  line.remove_prefix(1);
  skip_blanks();
  if (!line.starts_with("include")) return std::nullopt;
  line.remove_prefix(7);
  skip_blanks();
  if (line.empty() || (line.front() != '"' && line.front() != '<')) return std::nullopt;
  const bool quoted = line.front() == '"';
  line.remove_prefix(1);
  const std::size_t end = line.find(quoted ? '"' : '>');
  if (end == std::string_view::npos) return std::nullopt;
  return Include{std::string(line.substr(0, end)), quoted};
}

std::optional<std::string> violation(std::string_view file, const Include& include) {
  const std::string what = std::string(file) + ": #include of " + include.header;
  if (!include.quoted) {
    for (const LibraryRule& rule : library_rules()) {
      if (!covers(rule.header, include.header)) continue;
      const bool somewhere =
          std::ranges::any_of(rule.only_in, [&](std::string_view folder) { return file.starts_with(folder); });
      const bool forbidden =
          std::ranges::any_of(rule.but_not_in, [&](std::string_view folder) { return file.starts_with(folder); });
      const bool daemon = file.starts_with("firmware/daemon/");
      if (!somewhere || (forbidden && !daemon)) return what + ": " + std::string(rule.why);
    }
    return std::nullopt;
  }
  const bool test = file.starts_with("tests/");
  if (include.header.find('/') == std::string::npos || include.header.starts_with("../")) {
    if (test) return std::nullopt;  // a suite's own helper, or one in the same folder
    return what + ": write includes from the root, such as \"hal/head.h\"";
  }
  if (test) return std::nullopt;
  const std::string folder = folder_of(file);
  const std::string from = folder_of(include.header);
  const auto line = include_table().find(folder);
  if (line == include_table().end()) return what + ": the folder has no line in .cmake/includes.txt";
  const bool seen = std::ranges::any_of(
      line->second, [&](const std::string& name) { return name == from || name == include.header; });
  if (from == folder || seen) return std::nullopt;
  return what + ": " + folder + " may include only " + join(line->second);
}

}  // namespace nodal::tidy
