// Strict JSON: no duplicate key, limited depth, and errors with line and column. Only the parts of a document that its
// reader knows are kept, so the reader bounds the memory, not the author.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "protocol/base/result.h"

namespace nodal {

struct JsonLimits {
  std::size_t bytes = 1 << 20;
  int depth = 16;
};

/// Says which parts of a document are kept. A value of another kind than the shape says is kept as an empty value of
/// its own kind, and a list or text that is too long is cut one element behind its limit, so that the reader of the
/// tree can refuse it. The first field of an object that is not in the shape is kept as null, the others are dropped.
class JsonShape {
 public:
  /// A number, true, false, null, or a text of at most `text_bytes`.
  static JsonShape value(std::size_t text_bytes = 64);
  static JsonShape list(std::size_t most, JsonShape of);
  /// Calls `each` for every element; the tree has an empty list. Such lists are not nested.
  static JsonShape stream(JsonShape of, std::function<void(const nlohmann::json&)> each);
  static JsonShape object(std::map<std::string, JsonShape, std::less<>> fields);

 private:
  friend class JsonBuilder;
  enum class Kind : std::uint8_t { kValue, kList, kStream, kObject };
  Kind kind_ = Kind::kValue;
  std::size_t most_ = 0;  ///< bytes of a text, elements of a list
  std::shared_ptr<const JsonShape> of_{};
  std::function<void(const nlohmann::json&)> each_{};
  std::map<std::string, JsonShape, std::less<>> fields_{};
};

/// The next piece of a text, valid until the next call; an empty one ends it.
using TextPieces = std::function<Result<std::string_view>()>;
/// A text that is in memory, as one piece.
TextPieces one_piece(std::string_view text);

/// Errors: those of the pieces; kTooLarge over a limit; kTruncated if the text ends early; kBadFormat otherwise, with
/// line and column; the error names a key that appears twice in one object.
Result<nlohmann::json> parse_strict_json(const TextPieces& pieces, const JsonLimits& limits, const JsonShape& shape);
Result<nlohmann::json> parse_strict_json(std::string_view text, const JsonLimits& limits, const JsonShape& shape);

}  // namespace nodal
