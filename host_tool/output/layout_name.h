// Layouts as users name them.
#pragma once

#include <string>

#include "host_tool/console/files.h"
#include "protocol/base/result.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::host {

/// The layout with a name as users write it: also "rays:FILE". Errors: those of LayoutName::parse() and read_file().
inline Result<geometry::LayoutName> layout_named(const std::string& text) {
  return geometry::LayoutName::parse(text, [](const std::string& file) { return read_file(file, kMaxRayFileBytes); });
}

}  // namespace nodal::host
