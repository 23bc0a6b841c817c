// The checkout for the tidy tests: its text files, without build results and downloads.
#pragma once

#include <string>
#include <vector>

namespace nodal::tidy {

struct TextFile {
  std::string path;  ///< from the root, with slashes
  std::vector<std::string> lines;
};

/// All text files of the project, sorted by path. Without .git, build trees and the plain names in
/// .gitignore.
const std::vector<TextFile>& project_files();
/// The paths of all files of the project, text or not.
const std::vector<std::string>& project_paths();

bool is_source(const std::string& path);  ///< C++: .h, .cpp
/// Folders of modules with C++ files, such as "stitch/blend"; without tests.
std::vector<std::string> module_folders();

}  // namespace nodal::tidy
