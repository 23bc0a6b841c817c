// Who may include whom: design's table as data, and the judgement of one #include by it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nodal::tidy {

/// What the files of one folder (and of the folders below it that have no rule of their own) may include.
/// A name that ends in "/" is a whole folder, any other one header.
struct FolderRule {
  std::string_view folder;
  std::vector<std::string_view> may_include;
};
const std::vector<FolderRule>& folder_rules();

/// A library's or the system's headers that only some folders may see, and why. A name that ends in "/" is
/// every header below it; of the folders likewise.
struct LibraryRule {
  std::string_view header;
  std::vector<std::string_view> only_in;
  std::vector<std::string_view> but_not_in;
  std::string_view why;
};
const std::vector<LibraryRule>& library_rules();

/// One line of a file: `#include "header"` or `#include <header>`.
struct Include {
  std::string header;
  bool quoted = false;
};
std::optional<Include> parse_include(std::string_view line);

/// What is wrong with `file` (a path from the root) including this, in one sentence; nothing when it may.
std::optional<std::string> violation(std::string_view file, const Include& include);

}  // namespace nodal::tidy
