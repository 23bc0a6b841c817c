// The GPIO lines of rig.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "protocol/toml/toml_reader.h"

namespace nodal::firmware {

/// What may follow the line's number, after commas.
struct LineOptions {
  bool low = false;                 ///< ",low": on, or pressed, is the low level
  bool pull = false;                ///< ",pull-up" or ",pull-down"
  std::string_view otherwise = "";  ///< what else is allowed, for the message
};

/// The line under `key`: a GpioLine, or nothing when the key is missing or its value is refused.
std::optional<GpioLine> read_line(TomlReader& reader, std::string_view key, const LineOptions& allowed);

/// Call after all tables are read: lines are named once; trigger lines fit the source, the heads and their delays.
void check_lines(TomlReader& file, const RigConfig& config);

}  // namespace nodal::firmware
