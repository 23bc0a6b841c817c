#include "protocol/toml/toml_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "protocol/base/nearest_word.h"
#include "protocol/base/text.h"

namespace nodal {
namespace {

std::string listed(std::span<const std::string_view> words) {
  std::string all;
  for (const std::string_view word : words) {
    if (!all.empty()) all += ", ";
    all += word;
  }
  return all;
}

std::string shown(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

/// Keys and values come from the file, so messages contain printable characters only and at most kLongest bytes.
std::string excerpt(std::string_view text) {
  constexpr std::size_t kLongest = 64;
  return printable(text, kLongest) + (text.size() > kLongest ? "..." : "");
}

}  // namespace

void FirstError::set(Errc code, const toml::source_region& where, const std::string& message) {
  if (error_) return;
  std::string place = file_;
  if (where.begin.line > 0) {
    place += ':';
    place += std::to_string(where.begin.line);
    place += ':';
    place += std::to_string(where.begin.column);
  }
  error_ = Error{code, place + ": " + message};
}

TomlReader::TomlReader(const toml::table& table, std::string name, std::initializer_list<std::string_view> known,
                       FirstError& error)
    : table_(table), name_(std::move(name)), error_(error) {
  // The table is sorted by key; the error is about the first unknown key in the order of the file.
  const toml::key* first_unknown = nullptr;
  for (const auto& [key, node] : table_) {
    if (std::find(known.begin(), known.end(), key.str()) != known.end()) continue;
    if (!first_unknown || key.source().begin < first_unknown->source().begin) first_unknown = &key;
  }
  if (!first_unknown) return;
  std::string message = "there is no key '" + field(excerpt(first_unknown->str())) + "'; ";
  const std::span words(known.begin(), known.size());
  const std::string_view near = nearest_word(first_unknown->str(), words);
  message += near.empty() ? "the keys allowed here are " + listed(words) : "did you mean '" + std::string(near) + "'?";
  error_.set(Errc::kUnknownField, first_unknown->source(), message);
}

std::string TomlReader::field(std::string_view key) const {
  return name_.empty() ? std::string(key) : name_ + "." + std::string(key);
}

void TomlReader::refuse(std::string_view key, const std::string& message, Errc code) {
  const toml::node* node = table_.get(key);
  error_.set(code, node ? node->source() : table_.source(), field(key) + " " + message);
}

const toml::node* TomlReader::find(std::string_view key, toml::node_type type, std::string_view what) {
  const toml::node* node = table_.get(key);
  if (!node) return nullptr;
  if (node->type() == type) return node;
  refuse(key, "must be " + std::string(what));
  return nullptr;
}

std::string TomlReader::text(std::string_view key, std::string fallback) {
  const toml::node* node = find(key, toml::node_type::string, "text in quotes");
  return node ? node->as_string()->get() : fallback;
}

std::string TomlReader::required_text(std::string_view key) {
  if (!has(key)) refuse(key, "is missing", Errc::kMissingField);
  std::string value = text(key, "");
  if (has(key) && value.empty()) refuse(key, "must not be empty");
  return value;
}

std::int64_t TomlReader::integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback) {
  const toml::node* node = find(key, toml::node_type::integer, "a whole number");
  if (!node) return fallback;
  const std::int64_t value = node->as_integer()->get();
  if (value >= low && value <= high) return value;
  refuse(key, fmt::format("is {}; allowed is {} to {}", value, low, high));
  return fallback;
}

double TomlReader::number(std::string_view key, double low, double high, double fallback) {
  const toml::node* node = table_.get(key);
  if (!node) return fallback;
  if (!node->is_number()) {
    refuse(key, "must be a number");
    return fallback;
  }
  const double value =
      node->is_integer() ? static_cast<double>(node->as_integer()->get()) : node->as_floating_point()->get();
  if (value >= low && value <= high) return value;
  refuse(key, "is " + shown(value) + "; allowed is " + shown(low) + " to " + shown(high));
  return fallback;
}

bool TomlReader::boolean(std::string_view key, bool fallback) {
  const toml::node* node = find(key, toml::node_type::boolean, "true or false");
  return node ? node->as_boolean()->get() : fallback;
}

/// The index of the key's word in `allowed`; 0 when the key is missing or its word is not allowed.
std::size_t TomlReader::choose(std::string_view key, std::span<const std::string_view> allowed) {
  if (!has(key)) return 0;
  const std::string value = text(key, "");
  const auto found = std::find(allowed.begin(), allowed.end(), value);
  if (found != allowed.end()) return static_cast<std::size_t>(found - allowed.begin());
  refuse(key, "is \"" + excerpt(value) + "\"; allowed is one of " + listed(allowed));
  return 0;
}

const toml::array* TomlReader::array(std::string_view key) {
  const toml::node* node = find(key, toml::node_type::array, "an array");
  return node ? node->as_array() : nullptr;
}

const toml::table* TomlReader::table(std::string_view key) {
  const toml::node* node = find(key, toml::node_type::table, "a table, [" + field(key) + "]");
  return node ? node->as_table() : nullptr;
}

}  // namespace nodal
