// Reads one TOML table by its allowed keys and records the first error.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#define TOML_EXCEPTIONS 0
#include <toml++/toml.h>

#include "protocol/base/result.h"

namespace nodal {

/// The first error of a file. Later errors are not recorded: they are often consequences of the first.
class FirstError {
 public:
  explicit FirstError(std::string_view file) : file_(file) {}
  void set(Errc code, const toml::source_region& where, const std::string& message);
  bool any() const { return error_.has_value(); }
  const Error& get() const { return *error_; }

 private:
  std::string file_;
  std::optional<Error> error_;
};

/// An allowed word and its value.
template <class Value>
struct Named {
  std::string_view name;
  Value value;
};

/// One table of the file. Every read function returns the default when the key is missing or its value is not allowed.
class TomlReader {
 public:
  /// `name` is the name of the table in messages: "rig", "heads[3]", or empty for the root table.
  /// A key that is not in `known` is an error that suggests the nearest known key.
  TomlReader(const toml::table& table, std::string name, std::initializer_list<std::string_view> known,
             FirstError& error);

  bool has(std::string_view key) const { return table_.contains(key); }
  std::string text(std::string_view key, std::string fallback);
  std::string required_text(std::string_view key);
  std::int64_t integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback);
  double number(std::string_view key, double low, double high, double fallback);
  bool boolean(std::string_view key, bool fallback);
  /// The value that belongs to the key's word; the first value when the key is missing or its word is not allowed.
  template <class Value>
  Value choice(std::string_view key, std::initializer_list<Named<Value>> allowed) {
    std::vector<std::string_view> names;
    for (const Named<Value>& one : allowed) names.push_back(one.name);
    return allowed.begin()[choose(key, names)].value;
  }
  const toml::array* array(std::string_view key);
  const toml::table* table(std::string_view key);

  /// Records the error that this key's value is not allowed. `message` completes the sentence "KEY …".
  void refuse(std::string_view key, const std::string& message, Errc code = Errc::kBadValue);
  int line() const { return static_cast<int>(table_.source().begin.line); }

 private:
  std::string field(std::string_view key) const;
  std::size_t choose(std::string_view key, std::span<const std::string_view> allowed);
  const toml::node* find(std::string_view key, toml::node_type type, std::string_view what);

  const toml::table& table_;
  std::string name_;
  FirstError& error_;
};

}  // namespace nodal
