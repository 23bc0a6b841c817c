// Fields of another program's JSON, with errors that name the field's place.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::interchange {

/// Errors: kTooLarge, kBadFormat.
Result<nlohmann::json> parse_foreign_json(std::string_view text);

/// An object and how to call it in errors. Keeps nothing alive.
class JsonFields {
 public:
  JsonFields(const nlohmann::json& object, std::string where) : object_(object), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  bool has(const char* key) const { return object_.is_object() && object_.contains(key); }
  const nlohmann::json& operator[](const char* key) const { return object_.at(key); }

  /// Errors: kMissingField, kBadValue when it is no finite number.
  Result<double> number(const char* key) const;
  Result<double> number_or(const char* key, double otherwise) const;
  /// Between `least` and `most` numbers in a list.
  Result<std::vector<double>> numbers(const char* key, std::size_t least, std::size_t most) const;
  /// Errors: kMissingField, kBadValue.
  Result<std::string> text(const char* key) const;
  /// A picture's side. Errors: kMissingField, kBadValue outside 1..32768.
  Result<int> side(const char* key) const;

 private:
  tl::unexpected<Error> missing(const char* key) const;
  tl::unexpected<Error> bad(const char* key, const std::string& wanted) const;
  const nlohmann::json& object_;
  std::string where_;
};

}  // namespace nodal::interchange
