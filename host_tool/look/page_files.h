// The page's files, which are part of the program.
#pragma once

#include <optional>
#include <string>

#include "host_tool/look/server.h"

namespace nodal::host::look {

/// The file of host_tool/page with this name, "" meaning index.html; nothing if there is none.
std::optional<Answer> page_file(const std::string& name);

}  // namespace nodal::host::look
