#include "tree.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace nodal::tidy {
namespace {

namespace fs = std::filesystem;

std::set<std::string> ignored_names(const fs::path& root) {
  std::set<std::string> names{".git", "build"};
  std::ifstream ignore(root / ".gitignore");
  for (std::string line; std::getline(ignore, line);) {
    if (line.find('*') != std::string::npos) continue;
    if (line.ends_with('/')) line.pop_back();
    names.insert(line.substr(line.starts_with('/') ? 1 : 0));
  }
  return names;
}

bool is_text(const std::string& content) { return std::find(content.begin(), content.end(), '\0') == content.end(); }

std::vector<std::string> list_tree() {
  const fs::path root = NODAL_SOURCE_DIR;
  const std::set<std::string> ignored = ignored_names(root);
  std::vector<std::string> paths;
  for (fs::recursive_directory_iterator it(root), end; it != end; ++it) {
    if (ignored.contains(it->path().filename().string())) {  // .git is a file in a linked worktree
      it.disable_recursion_pending();
      continue;
    }
    if (!it->is_regular_file() || it->path().extension() == ".swp") continue;
    paths.push_back(fs::relative(it->path(), root).generic_string());
  }
  std::ranges::sort(paths);
  return paths;
}

std::vector<TextFile> read_tree() {
  std::vector<TextFile> files;
  for (const std::string& path : project_paths()) {
    std::ifstream in(fs::path(NODAL_SOURCE_DIR) / path, std::ios::binary);
    std::stringstream content;
    content << in.rdbuf();
    if (!is_text(content.str())) continue;
    TextFile file{path, {}};
    for (std::string line; std::getline(content, line);) file.lines.push_back(line);
    files.push_back(std::move(file));
  }
  return files;
}

}  // namespace

const std::vector<std::string>& project_paths() {
  static const std::vector<std::string> paths = list_tree();
  return paths;
}

const std::vector<TextFile>& project_files() {
  static const std::vector<TextFile> files = read_tree();
  return files;
}

bool is_source(const std::string& path) { return path.ends_with(".h") || path.ends_with(".cpp"); }

std::vector<std::string> module_folders() {
  std::set<std::string> folders;
  for (const TextFile& file : project_files()) {
    if (is_source(file.path) && !file.path.starts_with("tests/")) {
      folders.insert(fs::path(file.path).parent_path().generic_string());
    }
  }
  return {folders.begin(), folders.end()};
}

}  // namespace nodal::tidy
