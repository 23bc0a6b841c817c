// The option --layout of commands that make or use a raymap.
#pragma once

#include <string>

#include "host_tool/commands/command.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::host {

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
  return command.add_option("--layout", layout, help)->type_name("NAME");
}

}  // namespace nodal::host
