// Reads one TOML table by the keys it may have, and remembers the first thing that is wrong with it.
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

namespace nodal::firmware {

/// The first error of a file; later ones are not recorded, since one clear error is enough to act on.
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

/// A word of the file and what it stands for.
template <class Value>
struct Named {
  std::string_view name;
  Value value;
};

/// One table of the file. Every reader returns the default when the key is not there or is wrong.
class TomlReader {
 public:
  /// `name` is how messages call the table: "rig", "heads[3]", or empty for the file itself.
  /// Keys that are not in `known` are an error that names the nearest of them.
  TomlReader(const toml::table& table, std::string name, std::initializer_list<std::string_view> known,
             FirstError& error);

  bool has(std::string_view key) const { return table_.contains(key); }
  std::string text(std::string_view key, std::string fallback);
  std::string required_text(std::string_view key);
  std::int64_t integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback);
  double number(std::string_view key, double low, double high, double fallback);
  bool boolean(std::string_view key, bool fallback);
  /// The value beside the name that the key holds; the first one's where there is no such key, or another name.
  template <class Value>
  Value choice(std::string_view key, std::initializer_list<Named<Value>> allowed) {
    std::vector<std::string_view> names;
    for (const Named<Value>& one : allowed) names.push_back(one.name);
    return allowed.begin()[choose(key, names)].value;
  }
  const toml::array* array(std::string_view key);
  const toml::table* table(std::string_view key);

  /// Reports that this key's value is not allowed.
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

}  // namespace nodal::firmware
