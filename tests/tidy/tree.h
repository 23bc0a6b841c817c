// The checkout as the tidy tests see it: its text files, without what is built or fetched.
#pragma once

#include <string>
#include <vector>

namespace nodal::tidy {

struct TextFile {
  std::string path;  ///< from the root, with slashes
  std::vector<std::string> lines;
};

/// Every file of the project that is text, sorted by path. Leaves out .git, build trees and what .gitignore's
/// plain names leave out.
const std::vector<TextFile>& project_files();
/// The paths of all files of the project, text or not.
const std::vector<std::string>& project_paths();

bool is_source(const std::string& path);  ///< C++: .h, .cpp
/// Folders of the root's modules that hold C++ themselves, such as "stitch/blend"; tests are not among them.
std::vector<std::string> module_folders();

}  // namespace nodal::tidy
