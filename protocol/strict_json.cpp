#include "protocol/strict_json.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

namespace nodal {
namespace {

using nlohmann::json;

std::string place_of(std::string_view text, std::size_t offset) {
  const std::string_view before = text.substr(0, std::min(offset, text.size()));
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t last = before.rfind('\n');
  const std::size_t column = last == std::string_view::npos ? before.size() : before.size() - last - 1;
  return "line " + std::to_string(line) + ", column " + std::to_string(std::max<std::size_t>(column, 1));
}

/// Builds the tree from the parser's events; the first refusal is the error.
class Builder final : public nlohmann::json_sax<json> {
 public:
  Builder(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (open_.back()->contains(name)) {
      error_ = Error{Errc::kBadFormat, "the field '" + name + "' is given twice in one object"};
      return false;
    }
    key_ = std::move(name);
    return true;
  }

  bool parse_error(std::size_t position, const std::string& token, const json::exception& why) override {
    const bool number = std::string_view(why.what()).find("number overflow") != std::string_view::npos;
    if (position > text_.size() || token.empty() || (position >= text_.size() && !number && ends_early(why))) {
      error_ = Error{Errc::kTruncated, "the JSON ends too early, at " + place_of(text_, text_.size())};
      return false;
    }
    std::string what = number ? "a number too large to represent" : "not valid JSON";
    const char first = token.empty() ? '\0' : token.back();
    if (first == 'N' || first == 'I') what += " (NaN and Infinity are not numbers here)";
    error_ = Error{Errc::kBadFormat, what + " at " + place_of(text_, position)};
    return false;
  }

  Result<json> take() {
    if (error_) return fail(*error_);
    return std::move(root_);
  }

 private:
  static bool ends_early(const json::exception& why) {
    return std::string_view(why.what()).find("unexpected end of input") != std::string_view::npos ||
           std::string_view(why.what()).find("missing closing quote") != std::string_view::npos;
  }

  json* place(json value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    return &(parent[key_] = std::move(value));
  }

  bool add(json value) {
    place(std::move(value));
    return true;
  }

  bool open(json value) {
    if (static_cast<int>(open_.size()) >= limits_.depth) {
      error_ = Error{Errc::kTooLarge, "the JSON is nested more than " + std::to_string(limits_.depth) + " deep"};
      return false;
    }
    open_.push_back(place(std::move(value)));
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  std::string_view text_;
  JsonLimits limits_;
  json root_;
  std::vector<json*> open_;  // stays valid: a parent grows only at its end, and an open child is that end
  std::string key_;
  std::optional<Error> error_;
};

}  // namespace

Result<json> parse_strict_json(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.bytes) {
    return fail(Errc::kTooLarge, "the document has " + std::to_string(text.size()) + " bytes; at most " +
                                     std::to_string(limits.bytes) + " are read");
  }
  if (text.find('\0') != std::string_view::npos) {
    return fail(Errc::kBadFormat, "the document has a zero byte in it; it is not JSON text");
  }
  Builder builder(text, limits);
  json::sax_parse(text.begin(), text.end(), &builder);
  return builder.take();
}

}  // namespace nodal
