#include "stitch/geometry/raymap/layout.h"

#include <fmt/format.h>

#include "protocol/base/try.h"

namespace nodal::geometry {

Result<std::unique_ptr<RaymapLayout>> make_layout(const LayoutName& name, int width, int height) {
  if (width < 1 || height < 1 || width > kMaxRaymapSide || height > kMaxRaymapSide) {
    return fail(Errc::kBadValue,
                fmt::format("a raymap of {}x{} pixels: each side must be 1 to {}", width, height, kMaxRaymapSide));
  }
  return name.kind().make({width, height}, name.value());
}

Result<std::unique_ptr<RaymapLayout>> make_layout(std::string_view text, int width, int height) {
  NODAL_TRY_ASSIGN(const LayoutName name, LayoutName::parse(text));
  return make_layout(name, width, height);
}

}  // namespace nodal::geometry
