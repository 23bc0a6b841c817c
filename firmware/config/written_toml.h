// Reads back a rig.toml that a program of Nodal wrote, before anything counts on it. Without the types of config.h, so
// that the host's commands may use it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::firmware {

/// A head of a rig.toml: its name, and its port as the file has it.
struct WrittenHead {
  std::string name;
  std::string port;
  friend bool operator==(const WrittenHead&, const WrittenHead&) = default;
};

/// Parses `text` as nodald does. `file` names it in errors.
/// Errors: those of parse_rig_config(); kBadValue if its heads are not `heads`.
Status check_written_toml(std::string_view text, std::string_view file, const std::vector<WrittenHead>& heads);

}  // namespace nodal::firmware
