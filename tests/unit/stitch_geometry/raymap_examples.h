// Raymap layouts of every kind, for their tests.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

inline constexpr double kPi = std::numbers::pi;

inline std::unique_ptr<RaymapLayout> made(std::string_view name, int width, int height) {
  Result<std::unique_ptr<RaymapLayout>> layout = make_layout(name, width, height);
  EXPECT_TRUE(layout) << (layout ? "" : layout.error().text());
  return std::move(*layout);
}

/// Each at an ordinary size and at a small or awkward one.
inline std::vector<std::unique_ptr<RaymapLayout>> every_layout() {
  struct Size {
    std::string_view text;
    int width, height;
  };
  std::vector<std::unique_ptr<RaymapLayout>> layouts;
  for (const auto& [text, width, height] : std::vector<Size>{{"equirectangular", 1024, 512},
                                                             {"equirectangular", 77, 31},
                                                             {"cube", 768, 512},
                                                             {"cube", 3 * 37, 2 * 37},
                                                             {"cube:pad=3", 3 * 37, 2 * 37},
                                                             {"cube_6x1:pad=1", 6 * 40, 40},
                                                             {"cube_cross", 4 * 33, 3 * 33},
                                                             {"equiangular_cube", 3 * 64, 2 * 64},
                                                             {"equiangular_cube:pad=2", 3 * 31, 2 * 31},
                                                             {"cylinder_equal_area", 400, 128},
                                                             {"cylinder_equal_area", 33, 7},
                                                             {"central_cylinder", 300, 100},
                                                             {"central_cylinder:fov=150", 51, 77},
                                                             {"mercator", 120, 120},
                                                             {"mercator", 31, 45},
                                                             {"dual_fisheye", 512, 256},
                                                             {"dual_fisheye", 2 * 31, 31},
                                                             {"dual_paraboloid", 512, 256},
                                                             {"dual_paraboloid", 2 * 31, 31},
                                                             {"octahedron", 200, 200},
                                                             {"octahedron", 14, 14},
                                                             {"tetrahedron", 300, 130},
                                                             {"tetrahedron", 41, 17},
                                                             {"icosahedron", 300, 104},
                                                             {"icosahedron", 61, 23},
                                                             {"dymaxion", 330, 156},
                                                             {"dymaxion", 67, 41},
                                                             {"sinusoidal", 400, 200},
                                                             {"sinusoidal", 61, 37},
                                                             {"hammer", 400, 200},
                                                             {"hammer", 61, 37},
                                                             {"compressed_spherical", 512, 256},
                                                             {"compressed_spherical", 62, 41},
                                                             {"healpix", 256, 192},
                                                             {"healpix", 4 * 7, 3 * 7},
                                                             {"stratified_random", 128, 64},
                                                             {"stratified_random:seed=9", 1, 40},
                                                             {"hammersley", 128, 64},
                                                             {"hammersley", 7, 11},
                                                             {"halton", 128, 64},
                                                             {"halton", 9, 5}}) {
    layouts.push_back(made(text, width, height));
  }
  return layouts;
}

inline std::string described(const RaymapLayout& layout) {
  return std::string(layout.name()) + " " + std::to_string(layout.width()) + "x" + std::to_string(layout.height());
}

/// Whether the whole pixel is on the map: its middle, and just inside of each corner and side, are where their own
/// rays are put back. Edge pixels of discs, and padding, are not.
inline bool is_whole(const RaymapLayout& layout, int i, int j) {
  for (const double x : {i + 1e-6, i + 0.5, i + 1 - 1e-6}) {
    for (const double y : {j + 1e-6, j + 0.5, j + 1 - 1e-6}) {
      const std::optional<Ray> ray = layout.ray(x, y);
      const std::optional<Pixel> back = ray ? layout.pixel(*ray) : std::nullopt;
      if (!back || std::abs(back->x - x) > 1e-7 || std::abs(back->y - y) > 1e-7) return false;
    }
  }
  return true;
}

}  // namespace nodal::geometry
