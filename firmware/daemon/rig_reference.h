// What RIG.md says about the keys of rig.toml, for `nodald --explain`.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::daemon {

/// firmware/RIG.md as it was when nodald was built.
extern const std::string_view kRigReference;

/// The keys that a text like RIG.md has a heading for, in its order: "rig.name", "takes.mode" and so on.
std::vector<std::string> explained_keys(std::string_view reference);

/// What the text says about a key ("takes.mode"; "mode": every key of that name) or a section ("takes", "[takes]"),
/// which lists its keys; in lines of kLineWidth characters, code as it is.
/// Errors: kNotFound, with the nearest key or all sections.
Result<std::string> explain(std::string_view reference, std::string_view key);

}  // namespace nodal::daemon
