// The line format that Hugin and PTGui inherited from Panorama Tools: a letter, then variables run together
// with their values: i w780 h480 f3 v88.9 r=0 n"cam0.png".
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::interchange {

/// One line; `number` is its place in the file, from 1.
struct ScriptLine {
  int number = 0;
  char kind = '#';  ///< i, o, p, c, k, m, v; '#' for a comment, kept whole in `comment`
  std::string comment;
  std::vector<std::pair<std::string, std::string>> variables;  ///< name and value, quotes taken off

  /// Nothing when the line does not have it; the last when it has it twice.
  const std::string* find(std::string_view name) const;
};

/// Every line of a script that is not empty. Lines end with LF, CRLF or the text.
/// Errors: kTooLarge, kTruncated for a quote that does not close, kBadFormat for bytes that are no text.
Result<std::vector<ScriptLine>> parse_script(std::string_view text, std::size_t max_bytes);

/// Errors: kBadValue that names line and variable.
Result<double> to_number(const ScriptLine& line, std::string_view name, std::string_view value);

/// "l,r,t,b" as in C and S variables.
Result<std::array<double, 4>> to_four_numbers(const ScriptLine& line, std::string_view name, std::string_view value);

/// The image lines of a script, whose variables may say "=2": as image 2 has it.
class ImageLines {
 public:
  void add(const ScriptLine* line) { lines_.push_back(line); }
  std::size_t size() const { return lines_.size(); }
  const ScriptLine& operator[](std::size_t image) const { return *lines_[image]; }

  /// A variable with its links followed; nothing when it is not there.
  /// Errors: kBadValue for no number, a link to no image, or links in a circle.
  Result<std::optional<double>> find_number(std::size_t image, std::string_view name) const;
  Result<double> number_or(std::size_t image, std::string_view name, double otherwise) const;

 private:
  std::vector<const ScriptLine*> lines_;
};

}  // namespace nodal::interchange
