// The blend in double precision: the reference for the fixed-point blend.
#pragma once

#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::test {

/// A component of a raymap before any rounding; not clamped.
struct RealPlane {
  int width = 0;
  int height = 0;
  std::vector<double> values;
  std::vector<bool> covered;  ///< whether any head sees the sample
};

/// Blends all components from the ray samples that the table quantizes. black[c] is the component's value for no
/// light.
std::vector<RealPlane> blend_in_double(const table::RaySampler& sampler, std::span<const ImageView> heads);

/// The same, rounded to the nearest level and clamped, as a packed picture of the raymap's format.
std::vector<std::uint8_t> round_to_levels(PixelFormat format, int width, int height,
                                          const std::vector<RealPlane>& planes);

}  // namespace nodal::test
