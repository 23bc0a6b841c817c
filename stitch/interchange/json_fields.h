// Fields of another program's JSON; errors name the field's position.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/known_fields.h"

namespace nodal::interchange {

/// Errors: kTooLarge, kBadFormat.
Result<nlohmann::json> parse_foreign_json(std::string_view text);

/// A JSON object and its name in errors. Keeps references only.
class JsonFields {
 public:
  JsonFields(const nlohmann::json& object, std::string where) : object_(object), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  bool has(const char* key) const { return object_.is_object() && object_.contains(key); }
  const nlohmann::json& operator[](const char* key) const { return object_.at(key); }

  /// Errors: kMissingField; kBadValue if it is not a finite number.
  Result<double> number(const char* key) const;
  Result<double> number_or(const char* key, double otherwise) const;
  /// Reads a list of `least` to `most` numbers.
  Result<std::vector<double>> numbers(const char* key, std::size_t least, std::size_t most) const;
  /// Errors: kMissingField, kBadValue.
  Result<std::string> text(const char* key) const;
  /// The width or height of a picture. Errors: kMissingField, kBadValue outside 1..32768.
  Result<int> side(const char* key) const;

 private:
  tl::unexpected<Error> missing(const char* key) const;
  tl::unexpected<Error> bad(const char* key, const std::string& wanted) const;
  const nlohmann::json& object_;
  std::string where_;
};

/// Shows the check all members of an object.
void see_members(const nlohmann::json& object, std::string_view place, const std::string& whose, FieldCheck& check);

}  // namespace nodal::interchange
