// The line format that Hugin and PTGui inherited from Panorama Tools: a letter, then variables directly followed by
// their values: i w780 h480 f3 v88.9 r=0 n"cam0.png".
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::interchange {

/// One line; `number` is its line number in the file, from 1.
struct ScriptLine {
  int number = 0;
  char kind = '#';  ///< i, o, p, c, k, m, v; '#' for a comment, kept whole in `comment`
  std::string comment;
  std::vector<std::pair<std::string, std::string>> variables;  ///< name and value, without quotes

  /// The last value of a variable on the line; nothing if it is not there.
  const std::string* find(std::string_view name) const;
};

/// All non-empty lines of a script. A line ends with LF, CRLF or the end of the text.
/// Errors: kTooLarge, kTruncated for a quote that is not closed, kBadFormat for bytes that are not text.
Result<std::vector<ScriptLine>> parse_script(std::string_view text, std::size_t max_bytes);

/// Errors: kBadValue, which names line and variable.
Result<double> to_number(const ScriptLine& line, std::string_view name, std::string_view value);

/// Parses "l,r,t,b" of C and S variables.
Result<std::array<double, 4>> to_four_numbers(const ScriptLine& line, std::string_view name, std::string_view value);

/// The image lines of a script. A variable can be a link: "=2" means the value of image 2.
class ImageLines {
 public:
  void add(const ScriptLine* line) { lines_.push_back(line); }
  std::size_t size() const { return lines_.size(); }
  const ScriptLine& operator[](std::size_t image) const { return *lines_[image]; }

  /// A variable's value with links resolved; nothing if it is not there.
  /// Errors: kBadValue for a value that is not a number, a link to a missing image, or a circle of links.
  Result<std::optional<double>> find_number(std::size_t image, std::string_view name) const;
  Result<double> number_or(std::size_t image, std::string_view name, double otherwise) const;

 private:
  std::vector<const ScriptLine*> lines_;
};

}  // namespace nodal::interchange
