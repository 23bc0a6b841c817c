#include "stitch/geometry/raymap/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stitch/geometry/raymap/cube.h"
#include "stitch/geometry/raymap/equirectangular.h"

namespace nodal::geometry {
namespace {

struct Known {
  std::string_view name;
  Result<std::unique_ptr<RaymapLayout>> (*make)(int width, int height);
  double radians_across;  ///< the width divided by pixels per radian, where pixels are largest
  RaymapSize step;        ///< the smallest size with subsampled chroma; sizes are multiples of it
};

/// To add a layout: add its header and source to this folder, and a line here.
constexpr std::array kKnown{
    Known{"equirectangular", &Equirectangular::make, 2 * std::numbers::pi, {4, 2}},
    Known{"cube", &Cube::make, 6, {6, 4}},  // a face is 2 wide at distance 1
};

Result<const Known*> find(std::string_view name) {
  std::string names;
  for (const Known& known : kKnown) {
    if (known.name == name) return &known;
    names += (names.empty() ? "" : ", ") + std::string(known.name);
  }
  return fail(Errc::kUnsupported,
              "no raymap layout is called '" + std::string(name.substr(0, 64)) + "'; there are: " + names);
}

}  // namespace

Result<double> width_for_resolution(std::string_view name, double pixels_per_radian) {
  const Result<const Known*> known = find(name);
  if (!known) return fail(known.error());
  return (*known)->radians_across * pixels_per_radian;
}

Result<RaymapSize> size_for_width(std::string_view name, double width) {
  const Result<const Known*> known = find(name);
  if (!known) return fail(known.error());
  const RaymapSize step = (*known)->step;
  const int most = kMaxRaymapSide / std::max(step.width, step.height);
  const double steps = std::ceil(width / step.width);
  const int count = steps >= 1 ? static_cast<int>(std::min<double>(steps, most)) : 1;
  return RaymapSize{count * step.width, count * step.height};
}

std::vector<std::string_view> layout_names() {
  std::vector<std::string_view> names;
  names.reserve(std::size(kKnown));
  for (const Known& known : kKnown) names.push_back(known.name);
  return names;
}

Result<std::unique_ptr<RaymapLayout>> make_layout(std::string_view name, int width, int height) {
  const Result<const Known*> known = find(name);
  if (!known) return fail(known.error());
  if (width < 1 || height < 1 || width > kMaxRaymapSide || height > kMaxRaymapSide) {
    return fail(Errc::kBadValue, "a raymap of " + std::to_string(width) + "x" + std::to_string(height) +
                                     " pixels: each side must be 1 to " + std::to_string(kMaxRaymapSide));
  }
  return (*known)->make(width, height);
}

}  // namespace nodal::geometry
