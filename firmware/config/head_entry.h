// One [[heads]] of rig.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "firmware/config/config.h"
#include "protocol/toml/toml_reader.h"

namespace nodal::firmware {

/// Reads and checks an entry; what is wrong is the reader's first error.
HeadConfig read_head(TomlReader& reader, FrameRate rate);

/// The key "name": 1 to 64 characters of A-Z a-z 0-9 . _ -
std::string read_name(TomlReader& reader);
/// A whole number above 0, and nothing after it.
std::optional<std::uint32_t> parse_whole(std::string_view text);

}  // namespace nodal::firmware
