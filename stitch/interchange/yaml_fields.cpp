#include "stitch/interchange/yaml_fields.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "protocol/base/try.h"
#include "stitch/interchange/foreign_head.h"

namespace nodal::interchange {

Result<YAML::Node> parse_foreign_yaml(std::string_view text) {
  NODAL_TRY(check_project_size(text));
  // OpenCV begins its files with %YAML:1.0, which only its own reader accepts.
  if (text.starts_with("%YAML")) text.remove_prefix(std::min(text.find('\n'), text.size()));
  try {
    return YAML::Load(std::string(text));
  } catch (const std::exception& problem) {
    return fail(Errc::kBadFormat, std::string("it is not YAML: ") + problem.what());
  }
}

bool yaml_number(const YAML::Node& node, double& value) {
  if (!node.IsDefined() || !node.IsScalar()) return false;
  std::string text = node.Scalar();
  if (text.starts_with('+')) text.erase(0, 1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  // OpenCV writes integers as "3."
  const std::string_view rest(end, static_cast<std::size_t>(text.data() + text.size() - end));
  return error == std::errc() && (rest.empty() || rest == ".") && std::isfinite(value);
}

void see_members(const YAML::Node& mapping, std::string_view place, const std::string& whose, FieldCheck& check) {
  constexpr std::size_t kMaxShown = 16;  // elements of a list
  if (!mapping.IsDefined() || !mapping.IsMap()) return;
  for (const auto& member : mapping) {
    if (!member.first.IsScalar()) continue;
    const YAML::Node& value = member.second;
    // A matrix has its numbers in `data`.
    const YAML::Node data = value.IsMap() && value["data"].IsDefined() ? value["data"] : value;
    std::string text = data.IsScalar() ? data.Scalar() : data.IsNull() ? "" : "...";
    if (data.IsSequence() && data.size() <= kMaxShown) {
      text.clear();
      for (const YAML::Node& element : data)
        text += (text.empty() ? "" : " ") + (element.IsScalar() ? element.Scalar() : "...");
    }
    check.see(place, member.first.Scalar(), text, whose);
  }
}

bool YamlFields::has(const std::string& key) const {
  return node_.IsDefined() && node_.IsMap() && node_[key].IsDefined() && !node_[key].IsNull();
}

YAML::Node YamlFields::at(const std::string& key) const { return node_[key]; }

tl::unexpected<Error> YamlFields::missing(const std::string& key) const {
  return fail(Errc::kMissingField, where_ + ": there is no field '" + key + "'");
}

tl::unexpected<Error> YamlFields::bad(const std::string& key, const std::string& wanted) const {
  return fail(Errc::kBadValue, where_ + ": the field '" + key + "' must be " + wanted);
}

Result<double> YamlFields::number(const std::string& key) const {
  if (!has(key)) return missing(key);
  double value = 0;
  if (!yaml_number(node_[key], value)) return bad(key, "a number");
  return value;
}

Result<double> YamlFields::number_or(const std::string& key, double otherwise) const {
  return has(key) ? number(key) : Result<double>(otherwise);
}

Result<std::string> YamlFields::text(const std::string& key) const {
  if (!has(key)) return missing(key);
  if (!node_[key].IsScalar()) return bad(key, "a text");
  return node_[key].Scalar();
}

Result<int> YamlFields::side(const std::string& key) const {
  return picture_side(number(key), where_ + ": the field '" + key + "'");
}

Result<std::vector<double>> YamlFields::numbers(const std::string& key) const {
  if (!has(key)) return missing(key);
  const YAML::Node list = node_[key];
  if (!list.IsSequence() || list.size() > 1024) return bad(key, "a list of numbers");
  std::vector<double> values;
  for (const YAML::Node& element : list) {
    double value = 0;
    if (!yaml_number(element, value)) return bad(key, "a list of numbers");
    values.push_back(value);
  }
  return values;
}

Result<std::vector<double>> YamlFields::matrix(const std::string& key, std::size_t rows, std::size_t columns) const {
  const std::string wanted = fmt::format("{} lists of {} numbers", rows, columns);
  if (!has(key)) return missing(key);
  const YAML::Node list = node_[key];
  if (!list.IsSequence() || list.size() != rows) return bad(key, wanted);
  std::vector<double> values;
  for (const YAML::Node& row : list) {
    if (!row.IsSequence() || row.size() != columns) return bad(key, wanted);
    for (const YAML::Node& element : row) {
      double value = 0;
      if (!yaml_number(element, value)) return bad(key, wanted);
      values.push_back(value);
    }
  }
  return values;
}

}  // namespace nodal::interchange
