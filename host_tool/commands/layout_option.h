// The options --layout and --size of commands that make or use a raymap.
#pragma once

#include <fmt/format.h>

#include <charconv>
#include <string>

#include "host_tool/commands/command.h"
#include "host_tool/output/layout_name.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::host {

/// The type of an option that takes a layout's name: NAME in the help, every name in the completion.
inline std::string layout_type() {
  std::string type = "NAME:";
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) type += std::string(kind.name) + "|";
  return type + "rays";
}

/// Checks an option's value, but not the file of "rays:FILE", which the command reads.
inline Status check_layout(const std::string& text) {
  if (text.starts_with("rays:")) return {};
  const Result<geometry::LayoutName> name = geometry::LayoutName::parse(text);
  return name ? Status{} : fail(name.error());
}
inline CLI::Validator layout_check() { return checked_by(check_layout); }

/// Adds --layout NAME; its help lists every layout.
inline CLI::Option* add_layout_option(CLI::App& command, std::string& layout, const std::string& what) {
  std::string help = what + ". One of:";
  std::size_t line = 80;
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    std::string word(kind.name);
    if (const auto& parameter = kind.parameter; !parameter.key.empty())
      word += "[:" + std::string(parameter.key) + "=N]";
    const bool begins = line + word.size() > 76;
    help += (begins ? "\n" : " ") + word;
    line = begins ? word.size() : line + 1 + word.size();
  }
  help += " rays:FILE";
  return command.add_option("--layout", layout, help)->type_name(layout_type())->check(layout_check());
}

/// "1920x1080". Errors: kBadValue unless both are 1 to `most`.
inline Result<geometry::RaymapSize> parse_size(const std::string& text, int most) {
  geometry::RaymapSize size;
  const char* end = text.data() + text.size();
  const auto [x, error] = std::from_chars(text.data(), end, size.width);
  bool good = error == std::errc() && x != end && *x == 'x';
  if (good) {
    const auto [at, wrong] = std::from_chars(x + 1, end, size.height);
    good = wrong == std::errc() && at == end;
  }
  if (!good || size.width < 1 || size.height < 1 || size.width > most || size.height > most)
    return fail(Errc::kBadValue, fmt::format("'{}': write WIDTHxHEIGHT, each 1 to {}", text, most));
  return size;
}

}  // namespace nodal::host
