#include "protocol/strict_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <vector>

namespace nodal {

using nlohmann::json;

namespace {

/// Far more than the longest text of any document, also with every character escaped. nlohmann's lexer keeps what it
/// has read since the last text or number.
constexpr std::size_t kLongestToken = 512 * 1024;

/// A text that arrives in pieces, byte by byte. Of white space between tokens only the first byte goes on to the lexer.
class Characters {
 public:
  Characters(const TextPieces& pieces, const JsonLimits& limits) : pieces_(pieces), limits_(limits) {}

  bool at_end() {
    if (error_ || ended_) return true;
    while (is_gap_ && fill() && is_space(piece_[at_])) pass();
    return !fill();
  }
  char current() const { return piece_[at_]; }
  void advance() {
    const char c = piece_[at_];
    is_gap_ = !in_text_ && is_space(c);
    if (in_text_ && !escaped_ && c == '\\') {
      escaped_ = true;
    } else {
      if (c == '"' && !escaped_) in_text_ = !in_text_;
      escaped_ = false;
    }
    pass();
    if (++token_ > kLongestToken) {
      error_ = Error{Errc::kTooLarge, fmt::format("the JSON has no text and no number for more than {} bytes before {}",
                                                  kLongestToken, place())};
    }
  }
  /// The lexer begins a new token.
  void token_taken() { token_ = 0; }

  bool ended() const { return ended_; }
  const std::optional<Error>& error() const { return error_; }
  /// Line and column of the byte that was taken last.
  std::string place() const { return fmt::format("line {}, column {}", line_, std::max<std::size_t>(column_, 1)); }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }

  /// False at the end, and after an error.
  bool fill() {
    if (error_ || ended_) return false;
    if (at_ == piece_.size()) {
      auto next = pieces_();
      at_ = 0;
      piece_ = next.value_or(std::string_view());
      if (!next) error_ = next.error();
      ended_ = next && piece_.empty();
      if (error_ || ended_) return false;
    }
    if (piece_[at_] != '\0') return true;
    error_ = Error{Errc::kBadFormat, "the document has a zero byte in it; it is not JSON text"};
    return false;
  }
  void pass() {
    if (piece_[at_] == '\n') {
      ++line_;
      column_ = 0;
    } else {
      ++column_;
    }
    ++at_;
    if (++bytes_ > limits_.bytes && !error_) {
      error_ =
          Error{Errc::kTooLarge, fmt::format("the document has more than the {} bytes that are read", limits_.bytes)};
    }
  }

  const TextPieces& pieces_;
  const JsonLimits& limits_;
  std::string_view piece_;
  std::size_t at_ = 0, bytes_ = 0, token_ = 0, line_ = 1, column_ = 0;
  bool in_text_ = false, escaped_ = false, is_gap_ = false, ended_ = false;
  std::optional<Error> error_;
};

/// What nlohmann's parser reads from; without Characters, the end.
class CharacterIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  explicit CharacterIterator(Characters* from = nullptr) : from_(from) {}
  char operator*() const { return from_->current(); }
  CharacterIterator& operator++() {
    from_->advance();
    return *this;
  }
  friend bool operator==(const CharacterIterator& a, const CharacterIterator& b) {
    return (!a.from_ || a.from_->at_end()) == (!b.from_ || b.from_->at_end());
  }

 private:
  Characters* from_;
};

}  // namespace

JsonShape JsonShape::value(std::size_t text_bytes) {
  JsonShape shape;
  shape.most_ = text_bytes;
  return shape;
}

JsonShape JsonShape::list(std::size_t most, JsonShape of) {
  JsonShape shape;
  shape.kind_ = Kind::kList;
  shape.most_ = most;
  shape.of_ = std::make_shared<const JsonShape>(std::move(of));
  return shape;
}

JsonShape JsonShape::stream(JsonShape of, std::function<void(const json&)> each) {
  JsonShape shape = list(0, std::move(of));
  shape.kind_ = Kind::kStream;
  shape.each_ = std::move(each);
  return shape;
}

JsonShape JsonShape::object(std::map<std::string, JsonShape, std::less<>> fields) {
  JsonShape shape;
  shape.kind_ = Kind::kObject;
  shape.fields_ = std::move(fields);
  return shape;
}

/// Builds the tree from the parser's events; the first refusal is the error.
class JsonBuilder final : public nlohmann::json_sax<json> {
 public:
  JsonBuilder(Characters& text, const JsonLimits& limits, const JsonShape& shape)
      : text_(text), limits_(limits), shape_(shape) {}

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add_token(value); }
  bool number_unsigned(number_unsigned_t value) override { return add_token(value); }
  bool number_float(number_float_t value, const string_t&) override { return add_token(value); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(json::object(), JsonShape::Kind::kObject); }
  bool start_array(std::size_t) override { return open(json::array(), JsonShape::Kind::kList); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool string(string_t& value) override {
    const JsonShape* const shape = next_shape();
    const std::size_t most = shape && shape->kind_ == JsonShape::Kind::kValue ? shape->most_ : kLongestKey;
    if (value.size() > most) value.resize(most + 1);
    return add_token(value);
  }

  bool key(string_t& name) override {
    text_.token_taken();
    const Open& in = open_.back();
    if (in.node && in.node->contains(name)) {
      error_ = Error{Errc::kBadFormat, "the field '" + name.substr(0, 64) + "' is given twice in one object"};
      return false;
    }
    key_ = name;
    return true;
  }

  bool parse_error(std::size_t, const std::string& token, const json::exception& why) override {
    const bool number = std::string_view(why.what()).find("number overflow") != std::string_view::npos;
    if (text_.ended() && !number) {
      error_ = Error{Errc::kTruncated, "the JSON ends too early, at " + text_.place()};
      return false;
    }
    std::string what = number ? "a number too large to represent" : "not valid JSON";
    const char first = token.empty() ? '\0' : token.back();
    if (first == 'N' || first == 'I') what += " (NaN and Infinity are not numbers here)";
    error_ = Error{Errc::kBadFormat, what + " at " + text_.place()};
    return false;
  }

  Result<json> take() {
    if (text_.error()) return fail(*text_.error());
    if (error_) return fail(*error_);
    return std::move(root_);
  }

 private:
  /// An object or list that is open; without `node`, its content is not kept.
  struct Open {
    json* node = nullptr;
    const JsonShape* shape = nullptr;
    bool has_unknown = false;  ///< a field that is not in the shape
  };

  /// Shape of the next value; null: the value is not kept, or it is a field that is not in the shape.
  const JsonShape* next_shape() const {
    if (open_.empty()) return &shape_;
    const Open& in = open_.back();
    if (!in.node) return nullptr;
    if (in.node->is_array()) return in.shape->of_.get();
    const auto field = in.shape->fields_.find(key_);
    return field == in.shape->fields_.end() ? nullptr : &field->second;
  }

  /// Where the value is kept; null: nowhere.
  json* place(json value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Open& in = open_.back();
    if (!in.node) return nullptr;
    if (in.shape->kind_ == JsonShape::Kind::kStream) {
      element_ = std::move(value);
      return &element_;
    }
    if (in.node->is_array()) {
      if (in.node->size() > in.shape->most_) return nullptr;
      in.node->push_back(std::move(value));
      return &in.node->back();
    }
    if (!next_shape()) {
      if (!std::exchange(in.has_unknown, true)) (*in.node)[key_.substr(0, kLongestKey)] = nullptr;
      return nullptr;
    }
    return &((*in.node)[key_] = std::move(value));
  }

  /// Adds a value for which the lexer begins a new token: a text or a number.
  bool add_token(json value) {
    text_.token_taken();
    return add(std::move(value));
  }

  bool add(json value) {
    if (place(std::move(value))) complete();
    return true;
  }

  bool open(json value, JsonShape::Kind kind) {
    if (static_cast<int>(open_.size()) >= limits_.depth) {
      error_ = Error{Errc::kTooLarge, fmt::format("the JSON is nested more than {} deep", limits_.depth)};
      return false;
    }
    const JsonShape* const shape = next_shape();
    json* const node = place(std::move(value));
    const bool is_list = shape && (shape->kind_ == JsonShape::Kind::kList || shape->kind_ == JsonShape::Kind::kStream);
    const bool fits = shape && (shape->kind_ == kind || (is_list && kind == JsonShape::Kind::kList));
    open_.push_back(fits ? Open{node, shape} : Open{});
    return true;
  }

  bool close() {
    open_.pop_back();
    complete();
    return true;
  }

  /// Gives an element of a stream to its reader.
  void complete() {
    if (open_.empty() || !open_.back().node || open_.back().shape->kind_ != JsonShape::Kind::kStream) return;
    open_.back().shape->each_(element_);
    element_ = nullptr;
  }

  static constexpr std::size_t kLongestKey = 80;

  Characters& text_;
  const JsonLimits& limits_;
  const JsonShape& shape_;
  json root_, element_;
  std::vector<Open> open_;  // stays valid: a parent grows only at its end, and an open child is that end
  std::string key_;
  std::optional<Error> error_;
};

TextPieces one_piece(std::string_view text) {
  return [text]() mutable -> Result<std::string_view> { return std::exchange(text, std::string_view()); };
}

Result<json> parse_strict_json(const TextPieces& pieces, const JsonLimits& limits, const JsonShape& shape) {
  Characters text(pieces, limits);
  JsonBuilder builder(text, limits, shape);
  json::sax_parse(CharacterIterator(&text), CharacterIterator(), &builder);
  return builder.take();
}

Result<json> parse_strict_json(std::string_view text, const JsonLimits& limits, const JsonShape& shape) {
  if (text.size() > limits.bytes) {
    return fail(Errc::kTooLarge,
                fmt::format("the document has {} bytes; at most {} are read", text.size(), limits.bytes));
  }
  return parse_strict_json(one_piece(text), limits, shape);
}

}  // namespace nodal
