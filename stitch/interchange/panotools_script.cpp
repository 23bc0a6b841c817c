#include "stitch/interchange/panotools_script.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "protocol/base/try.h"

namespace nodal::interchange {
namespace {

constexpr std::size_t kMaxLines = 100'000;

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_space(char c) { return c == ' ' || c == '\t'; }

std::string at_line(int number) { return fmt::format("line {}", number); }

Result<ScriptLine> parse_line(std::string_view text, int number) {
  ScriptLine line;
  line.number = number;
  if (text.front() == '#') {
    line.comment = std::string(text);
    return line;
  }
  line.kind = text.front();
  std::size_t at = 1;
  while (at < text.size()) {
    if (is_space(text[at])) {
      ++at;
      continue;
    }
    const std::size_t name_begin = at;
    while (at < text.size() && is_letter(text[at])) ++at;
    const std::string name(text.substr(name_begin, at - name_begin));
    std::size_t value_begin = at;
    std::size_t value_end;
    if (at < text.size() && text[at] == '"') {
      value_begin = at + 1;
      value_end = text.find('"', value_begin);
      if (value_end == std::string_view::npos) {
        return fail(Errc::kTruncated, at_line(number) + ": the quote after '" + name + "' does not close");
      }
      at = value_end + 1;
    } else {
      while (at < text.size() && !is_space(text[at])) ++at;
      value_end = at;
    }
    line.variables.emplace_back(name, text.substr(value_begin, value_end - value_begin));
  }
  return line;
}

}  // namespace

const std::string* ScriptLine::find(std::string_view name) const {
  const auto found = std::find_if(variables.rbegin(), variables.rend(), [&](const auto& v) { return v.first == name; });
  return found == variables.rend() ? nullptr : &found->second;
}

Result<std::vector<ScriptLine>> parse_script(std::string_view text, std::size_t max_bytes) {
  if (text.size() > max_bytes) {
    return fail(Errc::kTooLarge, fmt::format("the file has {} bytes; at most {} are read", text.size(), max_bytes));
  }
  if (text.find('\0') != std::string_view::npos) {
    return fail(Errc::kBadFormat, "this is a binary file, and a project is a text file");
  }
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  std::vector<ScriptLine> lines;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view one = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    while (!one.empty() && (is_space(one.back()) || one.back() == '\r')) one.remove_suffix(1);
    if (one.empty()) continue;
    if (lines.size() == kMaxLines) return fail(Errc::kTooLarge, "the file has more than 100000 lines");
    NODAL_TRY_ASSIGN(ScriptLine line, parse_line(one, number));
    lines.push_back(std::move(line));
  }
  return lines;
}

Result<double> to_number(const ScriptLine& line, std::string_view name, std::string_view value) {
  double number = 0;
  if (value.starts_with('+')) value.remove_prefix(1);
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc{} || end != value.data() + value.size() || !std::isfinite(number)) {
    return fail(Errc::kBadValue, at_line(line.number) + ": '" + std::string(name) + "' should be a number and is '" +
                                     std::string(value.substr(0, 40)) + "'");
  }
  return number;
}

Result<std::array<double, 4>> to_four_numbers(const ScriptLine& line, std::string_view name, std::string_view value) {
  std::array<double, 4> numbers{};
  for (std::size_t k = 0; k < 4; ++k) {
    const std::size_t comma = k < 3 ? value.find(',') : value.size();
    if (comma == std::string_view::npos) {
      return fail(Errc::kBadValue, at_line(line.number) + ": '" + std::string(name) +
                                       "' should be four numbers with commas: left, right, top, bottom");
    }
    NODAL_TRY_ASSIGN(const double number, to_number(line, name, value.substr(0, comma)));
    numbers[k] = number;
    value.remove_prefix(std::min(comma + 1, value.size()));
  }
  return numbers;
}

Result<std::optional<double>> ImageLines::find_number(std::size_t image, std::string_view name) const {
  const ScriptLine& first = *lines_[image];
  for (std::size_t links = 0; links <= lines_.size(); ++links) {
    const ScriptLine& line = *lines_[image];
    const std::string* value = line.find(name);
    if (value == nullptr) return std::optional<double>();
    const bool link = value->starts_with('=');
    NODAL_TRY_ASSIGN(const double number,
                     to_number(line, name, link ? std::string_view(*value).substr(1) : std::string_view(*value)));
    if (!link) return std::optional<double>(number);
    if (!(number >= 0 && number < static_cast<double>(lines_.size())) || number != std::floor(number)) {
      return fail(Errc::kBadValue, fmt::format("{}: '{}' is linked to image {}, and there are {}", at_line(line.number),
                                               name, value->substr(1, 20), lines_.size()));
    }
    image = static_cast<std::size_t>(number);
  }
  return fail(Errc::kBadValue, at_line(first.number) + ": '" + std::string(name) + "' is linked in a circle");
}

Result<double> ImageLines::number_or(std::size_t image, std::string_view name, double otherwise) const {
  NODAL_TRY_ASSIGN(const std::optional<double> number, find_number(image, name));
  return number.value_or(otherwise);
}

}  // namespace nodal::interchange
