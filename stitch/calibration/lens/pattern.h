// The lens calibration's pattern (§4.3): no fiducials, but detail at every scale, no repetition, and known exactly
// because it is generated.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::calibration {

/// The parameters of a pattern. The same spec gives the same bytes on every machine. All A-series paper has the same
/// shape, so one raster serves A5 to A0.
struct PatternSpec {
  int width = 4096;  ///< px
  int height = 2896;
  std::uint64_t seed = 1;
  friend bool operator==(const PatternSpec&, const PatternSpec&) = default;
};

inline constexpr int kMinPatternSide = 64;
inline constexpr int kMaxPatternSide = 16384;

/// 8-bit grey, rows packed. Values are sRGB-encoded reflectance, as printers and screens expect.
struct PatternRaster {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> values;
};

/// Draws discs of about seven octaves of size; each adds a random positive or negative step of grey. This gives edges
/// in every direction, about forty thousand at the default size, and light and dark patches up to a tenth of the
/// width.
///
/// Errors: kBadValue for sides outside kMinPatternSide..kMaxPatternSide.
Result<PatternRaster> make_pattern(const PatternSpec& spec);

}  // namespace nodal::calibration
