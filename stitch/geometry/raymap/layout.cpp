#include "stitch/geometry/raymap/layout.h"

#include <array>

#include "stitch/geometry/raymap/cube.h"
#include "stitch/geometry/raymap/equirectangular.h"

namespace nodal::geometry {
namespace {

struct Known {
  std::string_view name;
  Result<std::unique_ptr<RaymapLayout>> (*make)(int width, int height);
};

/// To add a layout: its header and source beside these, and a line here.
constexpr std::array kKnown{
    Known{"equirectangular", &Equirectangular::make},
    Known{"cube", &Cube::make},
};

}  // namespace

std::vector<std::string_view> layout_names() {
  std::vector<std::string_view> names;
  for (const Known& known : kKnown) names.push_back(known.name);
  return names;
}

Result<std::unique_ptr<RaymapLayout>> make_layout(std::string_view name, int width, int height) {
  std::string names;
  for (const Known& known : kKnown) {
    if (known.name == name) {
      if (width < 1 || height < 1 || width > kMaxRaymapSide || height > kMaxRaymapSide) {
        return fail(Errc::kBadValue, "a raymap of " + std::to_string(width) + "x" + std::to_string(height) +
                                         " pixels: each side must be 1 to " + std::to_string(kMaxRaymapSide));
      }
      return known.make(width, height);
    }
    names += (names.empty() ? "" : ", ") + std::string(known.name);
  }
  return fail(Errc::kUnsupported,
              "no raymap layout is called '" + std::string(name.substr(0, 64)) + "'; there are: " + names);
}

}  // namespace nodal::geometry
