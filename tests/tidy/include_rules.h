// The include rules: .cmake/includes.txt as data, and the check of one #include.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nodal::tidy {

/// By folder: the folders and headers that its sources may include besides its own headers.
using IncludeTable = std::map<std::string, std::vector<std::string>, std::less<>>;
/// Reads the format of .cmake/includes.txt.
IncludeTable parse_include_table(const std::vector<std::string>& lines);
/// The table of this checkout.
const IncludeTable& include_table();
/// A cycle of folders that include each other, in order; empty if there is none.
std::vector<std::string> cycle_in(const IncludeTable& table);

/// Headers of a library or the system that only some folders may include, and the reason. A name that ends in "/" means
/// every header below it; the same for folders.
struct LibraryRule {
  std::string_view header;
  std::vector<std::string_view> only_in;
  std::vector<std::string_view> but_not_in;
  std::string_view why;
};
const std::vector<LibraryRule>& library_rules();

/// One include line of a file: `#include "header"` or `#include <header>`.
struct Include {
  std::string header;
  bool quoted = false;
};
std::optional<Include> parse_include(std::string_view line);

/// The rule that `file` (a path from the root) breaks with this include, in one sentence; nothing if it is allowed.
std::optional<std::string> violation(std::string_view file, const Include& include);

}  // namespace nodal::tidy
