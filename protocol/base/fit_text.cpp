#include "protocol/base/fit_text.h"

#include <algorithm>

namespace nodal {
namespace {

/// Where the last column of a line begins: after two or more spaces in the line's first half. Without columns, and for
/// indented text, where the text begins.
std::size_t last_column_of(std::string_view line, std::size_t columns) {
  std::size_t begin = std::min(line.find_first_not_of(' '), line.size());
  for (std::size_t at = begin; (at = line.find("  ", at)) != std::string_view::npos;) {
    const std::size_t next = line.find_first_not_of(' ', at);
    if (next == std::string_view::npos || width_of(line.substr(0, next)) > columns / 2) break;
    begin = at = next;
  }
  return begin;
}

void add_fitted(std::string_view line, std::size_t columns, std::string& to) {
  const std::size_t begin = last_column_of(line, columns);
  const bool indents = line.substr(0, begin).find_first_not_of(' ') == std::string_view::npos;
  const std::size_t margin = width_of(line.substr(0, begin)) + (indents ? 2 : 0);
  if (width_of(line) <= columns || margin >= columns) {
    to += line;
    return;
  }
  to += line.substr(0, begin);
  bool continues = false;
  for (const std::string& part : wrapped(line.substr(begin), columns - margin)) {
    if (continues) to += '\n' + std::string(margin, ' ');
    to += part;
    continues = true;
  }
}

}  // namespace

std::size_t width_of(std::string_view text) {
  std::size_t width = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\x1b') {
      while (i < text.size() && text[i] != 'm') ++i;
    } else if ((static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) {
      ++width;
    }
  }
  return width;
}

std::vector<std::string> wrapped(std::string_view text, std::size_t width) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    if (lines.empty() || width_of(lines.back()) + 1 + width_of(word) > width) lines.emplace_back(word);
    else lines.back().append(" ").append(word);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::string fitted(std::string_view text, std::size_t columns) {
  std::string result;
  while (true) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    add_fitted(text.substr(0, end), columns, result);
    if (end == text.size()) return result;
    result += '\n';
    text.remove_prefix(end + 1);
  }
}

}  // namespace nodal
