#include "stitch/interchange/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/try.h"
#include "stitch/interchange/foreign_head.h"

namespace nodal::interchange {

using nlohmann::json;

namespace {

/// A value's text for a note: short, or only its kind.
std::string text_of(const json& value) {
  constexpr std::size_t kMaxShown = 16;  // elements of a list
  if (value.is_object()) return value.empty() ? "{}" : "{...}";
  if (!value.is_array() || value.empty()) return value.dump(-1, ' ', false, json::error_handler_t::replace);
  const bool plain = std::ranges::none_of(value, [](const json& element) { return element.is_structured(); });
  return plain && value.size() <= kMaxShown ? value.dump(-1, ' ', false, json::error_handler_t::replace) : "[...]";
}

}  // namespace

Result<json> parse_foreign_json(std::string_view text) {
  NODAL_TRY(check_project_size(text));
  json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded()) return fail(Errc::kBadFormat, "it is not JSON, or is cut off");
  return parsed;
}

tl::unexpected<Error> JsonFields::missing(const char* key) const {
  return fail(Errc::kMissingField, where_ + ": there is no field '" + key + "'");
}

tl::unexpected<Error> JsonFields::bad(const char* key, const std::string& wanted) const {
  return fail(Errc::kBadValue, where_ + ": the field '" + key + "' must be " + wanted);
}

Result<double> JsonFields::number(const char* key) const {
  if (!has(key)) return missing(key);
  const json& value = object_.at(key);
  if (!value.is_number() || !std::isfinite(value.get<double>())) return bad(key, "a number");
  return value.get<double>();
}

Result<double> JsonFields::number_or(const char* key, double otherwise) const {
  if (!has(key)) return otherwise;
  return number(key);
}

Result<std::vector<double>> JsonFields::numbers(const char* key, std::size_t least, std::size_t most) const {
  if (!has(key)) return missing(key);
  const json& list = object_.at(key);
  const std::string wanted =
      least == most ? fmt::format("{} numbers", least) : fmt::format("{} to {} numbers", least, most);
  if (!list.is_array() || list.size() < least || list.size() > most) return bad(key, wanted);
  std::vector<double> values;
  for (const json& value : list) {
    if (!value.is_number() || !std::isfinite(value.get<double>())) return bad(key, wanted);
    values.push_back(value.get<double>());
  }
  return values;
}

Result<std::string> JsonFields::text(const char* key) const {
  if (!has(key)) return missing(key);
  const json& value = object_.at(key);
  if (!value.is_string()) return bad(key, "a text");
  return value.get<std::string>();
}

Result<int> JsonFields::side(const char* key) const {
  return picture_side(number(key), where_ + ": the field '" + key + "'");
}

void see_members(const json& object, std::string_view place, const std::string& whose, FieldCheck& check) {
  if (!object.is_object()) return;
  for (const auto& [name, value] : object.items()) check.see(place, name, text_of(value), whose);
}

}  // namespace nodal::interchange
