// Reads [raymap] of a rig.toml.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/raymap_config.h"
#include "protocol/base/result.h"
#include "protocol/toml/toml_reader.h"

namespace nodal::sets {

/// A reader of the table [raymap]; a key that it does not have is an error.
TomlReader raymap_reader(const toml::table& raymap, FirstError& error);
/// Every key of it, checked by itself; that heads fit it is checked where the heads are known. `read` reads the file
/// that layout = "rays:FILE" names, without a folder; it becomes "rays:HASH".
RaymapConfig read_raymap(TomlReader& raymap, const ReadRayFile& read);

/// The raymaps of a rig.toml whose other tables are not read, such as that in a take. Errors: kBadFormat if it is not
/// TOML; those of its keys, with line and column.
Result<RaymapConfig> raymap_config_of(std::string_view rig_toml, const std::string& file, const ReadRayFile& read);

}  // namespace nodal::sets
