// The pattern that lenses are calibrated against (§4.3): no fiducials, but detail at every scale that
// never repeats, known by construction.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::calibration {

/// What a pattern is made from. The same spec gives the same bytes on every machine; all paper of the A series
/// has the same shape, so that one raster serves A5 to A0.
struct PatternSpec {
  int width = 4096;  ///< px
  int height = 2896;
  std::uint64_t seed = 1;
  friend bool operator==(const PatternSpec&, const PatternSpec&) = default;
};

inline constexpr int kMinPatternSide = 64;
inline constexpr int kMaxPatternSide = 16384;

/// 8-bit grey, rows packed. Values are sRGB-encoded reflectance, as printers and screens take them.
struct PatternRaster {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> values;
};

/// Discs of seven or so octaves of size, each adding or taking a random step of grey: edges in every direction,
/// some forty thousand of them at the default size, and light and dark patches as large as a tenth of the
/// width.
///
/// Errors: kBadValue for sides outside kMinPatternSide..kMaxPatternSide.
Result<PatternRaster> make_pattern(const PatternSpec& spec);

}  // namespace nodal::calibration
