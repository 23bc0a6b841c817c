// Who may include whom: .cmake/includes.txt as data, and the judgement of one #include by it.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nodal::tidy {

/// Each folder's line of the table: the folders and headers that its sources may include besides its own headers.
using IncludeTable = std::map<std::string, std::vector<std::string>, std::less<>>;
/// Reads the format of .cmake/includes.txt.
IncludeTable parse_include_table(const std::vector<std::string>& lines);
/// The table of this checkout.
const IncludeTable& include_table();
/// Folders that see one another in a circle, in order; empty when there is no circle.
std::vector<std::string> cycle_in(const IncludeTable& table);

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
