#include "stitch/interchange/panotools_fields.h"

#include <fmt/format.h>

#include <algorithm>

#include "protocol/base/try.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

constexpr std::string_view kDigits = "0123456789";
constexpr std::string_view kStack = "j";  // Hugin's; the number itself means nothing, but a link does

bool is_link(std::string_view value) {
  return value.size() > 1 && value.front() == '=' && value.find_first_not_of(kDigits, 1) == std::string_view::npos;
}

}  // namespace

std::vector<Attribute> attributes_of(std::string_view text) {
  constexpr std::string_view kBetween = " \t";
  std::vector<Attribute> all;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kBetween), text.size()));
    if (text.empty()) return all;
    const std::string_view word = text.substr(0, text.find_first_of(kBetween));
    const std::size_t equals = std::min(word.find('='), word.size());
    all.push_back({std::string(word.substr(0, equals)), std::string(word.substr(std::min(equals + 1, word.size())))});
    text.remove_prefix(word.size());
  }
}

Attribute setting_of(std::string_view text) {
  const auto is_name = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  const auto end = std::ranges::find_if_not(text, is_name);
  const auto length = static_cast<std::size_t>(end - text.begin());
  std::string_view value = text.substr(length);
  value.remove_prefix(std::min(value.find_first_not_of(" \t"), value.size()));
  return {std::string(text.substr(0, length)), std::string(value)};
}

void see_variables(const ScriptLine& line, FieldCheck& check) {
  const std::string where = fmt::format("line {}", line.number);
  for (const auto& [name, value] : line.variables) check.see(std::string(1, line.kind), name, value, where);
}

Status see_image(const ImageLines& images, std::size_t image, std::string_view place, const std::string& whose,
                 FieldCheck& check) {
  for (const auto& [name, value] : images[image].variables) {
    if (name == kStack) {
      check.see(place, name, is_link(value) ? value : "unlinked", whose);
    } else if (is_link(value)) {
      NODAL_TRY_ASSIGN(const double number, images.number_or(image, name, 0));
      check.see(place, name, short_number(number), whose);
    } else {
      check.see(place, name, value, whose);
    }
  }
  return {};
}

}  // namespace nodal::interchange
