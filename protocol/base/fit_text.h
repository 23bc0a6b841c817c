// Text that fits the width of a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace nodal {

/// The width that tables, help and status lines fit into, in characters.
inline constexpr std::size_t kLineWidth = 80;

/// The number of visible characters: escape sequences count 0, a multi-byte character counts 1.
std::size_t width_of(std::string_view text);

/// Breaks a text at spaces into lines of at most `width` visible characters; a longer word gets a line of its own.
std::vector<std::string> wrapped(std::string_view text, std::size_t width);

/// Breaks the lines that are wider than `columns` at spaces. The rest of a line is written under its last column (after
/// two or more spaces in its first half), or indented by two more than the line.
std::string fitted(std::string_view text, std::size_t columns = kLineWidth);

}  // namespace nodal
