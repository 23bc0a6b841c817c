// Fields of another program's YAML; errors name the field's position. Catches the library's exceptions.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/known_fields.h"

namespace nodal::interchange {

/// Errors: kTooLarge, kBadFormat with the line.
Result<YAML::Node> parse_foreign_yaml(std::string_view text);

/// A mapping and its name in errors.
class YamlFields {
 public:
  YamlFields(YAML::Node node, std::string where) : node_(std::move(node)), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  bool has(const std::string& key) const;
  /// The node at `key`, which has() must have confirmed.
  YAML::Node at(const std::string& key) const;

  /// Errors: kMissingField, kBadValue.
  Result<double> number(const std::string& key) const;
  Result<double> number_or(const std::string& key, double otherwise) const;
  Result<std::string> text(const std::string& key) const;
  Result<int> side(const std::string& key) const;
  /// A flat list of numbers.
  Result<std::vector<double>> numbers(const std::string& key) const;
  /// A list of `rows` lists of `columns` numbers each, row by row.
  Result<std::vector<double>> matrix(const std::string& key, std::size_t rows, std::size_t columns) const;

 private:
  tl::unexpected<Error> missing(const std::string& key) const;
  tl::unexpected<Error> bad(const std::string& key, const std::string& wanted) const;
  YAML::Node node_;
  std::string where_;
};

/// Shows the check all members of a mapping.
void see_members(const YAML::Node& mapping, std::string_view place, const std::string& whose, FieldCheck& check);

/// A scalar as a number; false if it is not a finite number.
bool yaml_number(const YAML::Node& node, double& value);

}  // namespace nodal::interchange
