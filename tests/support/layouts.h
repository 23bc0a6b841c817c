// Raymap layouts by name.
#pragma once

#include <memory>
#include <string_view>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::test {

/// The layout at its smallest size with at least this width.
inline std::unique_ptr<geometry::RaymapLayout> layout_of(std::string_view text, double width) {
  const geometry::LayoutName name = geometry::LayoutName::parse(text).value();
  const geometry::RaymapSize size = name.size_for_width(width);
  return geometry::make_layout(name, size.width, size.height).value();
}

inline bool holds_whole_sphere(const geometry::LayoutKind& kind) {
  return kind.name != "central_cylinder" && kind.name != "mercator";
}

}  // namespace nodal::test
