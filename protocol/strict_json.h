// Strict JSON: no duplicate key, limited depth, and errors with line and column.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal {

struct JsonLimits {
  std::size_t bytes = 1 << 20;
  int depth = 16;
};

/// Errors: kTooLarge over a limit; kTruncated if the text ends early; kBadFormat otherwise, with line and column; the
/// error names a key that appears twice in one object.
Result<nlohmann::json> parse_strict_json(std::string_view text, const JsonLimits& limits);

}  // namespace nodal
