// How a take's documents read their fields; only for the sources of this folder.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/base/result.h"
#include "protocol/base/text.h"
#include "protocol/base/units.h"
#include "protocol/strict_json.h"

namespace nodal::take {

using Json = nlohmann::json;

/// A field of an object; errors name the file and the field.
class JsonFields {
 public:
  JsonFields(const Json& json, std::string where) : json_(json), where_(std::move(where)) {}

  Result<std::uint64_t> number(const char* key, std::uint64_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_number_unsigned() || at->get<std::uint64_t>() > most)
      return wrong(key, fmt::format("not a number from 0 to {}", most));
    return at->get<std::uint64_t>();
  }
  Result<std::string> text(const char* key, std::size_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_string() || at->get_ref<const std::string&>().size() > most ||
        !is_printable(at->get_ref<const std::string&>())) {
      return wrong(key, fmt::format("not a text of at most {} bytes", most));
    }
    return at->get<std::string>();
  }
  Result<const Json*> list(const char* key, std::size_t most) const {
    const auto at = json_.find(key);
    if (at == json_.end()) return missing(key);
    if (!at->is_array() || at->size() > most) return wrong(key, fmt::format("not a list of at most {}", most));
    return &*at;
  }
  tl::unexpected<Error> wrong(const char* key, const std::string& how) const {
    return fail(Errc::kBadValue, fmt::format("{}: {}: {}", where_, key, how));
  }

 private:
  tl::unexpected<Error> missing(const char* key) const {
    return fail(Errc::kMissingField, fmt::format("{}: {} is missing", where_, key));
  }
  const Json& json_;
  const std::string where_;
};

/// A document of a take, with its version. `shape`: every field that this version reads; others are left out.
Result<Json> parse_document(const TextPieces& text, const std::string& file, std::size_t limit, const JsonShape& shape);

nlohmann::ordered_json rate_json(FrameRate rate);
Result<FrameRate> rate_in(const Json& list, const JsonFields& fields);

/// Takes a value out of a Result, or ends the parser with its error.
#define NODAL_TAKE(variable, result)                              \
  auto variable##_result = (result);                              \
  if (!variable##_result) return fail(variable##_result.error()); \
  auto& variable = *variable##_result

}  // namespace nodal::take
