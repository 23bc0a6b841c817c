// Filters between pixels, as taps in fixed point.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::view {

enum class Filter : std::uint8_t {
  kNearest,
  kBilinear,
  kBicubic,  ///< Catmull and Rom's, -1/2
  kLanczos,  ///< sinc(t) sinc(t / 3), six taps, their sum made 1
};

/// Parses "nearest", "bilinear", "bicubic", "lanczos". Errors: kBadValue, which lists the names.
Result<Filter> parse_filter(std::string_view text);

/// A filter's weights along one axis for every 1/256 of a pixel.
struct Taps {
  static constexpr int kPhases = 256;
  static constexpr int kOne = 16384;
  static constexpr int kFineOne = 1 << 22;

  int count = 1;   ///< 1, 2, 4, 6
  int before = 0;  ///< taps before the pixel that the position falls behind
  /// Weights of a position p/256 px behind the centre of a pixel; they sum to kOne. Unused ones are 0.
  std::array<std::array<std::int16_t, 8>, kPhases> phases{};
  /// The same for samples of 16 bits; they sum to kFineOne.
  std::array<std::array<std::int32_t, 8>, kPhases> fine{};
  /// Taps count from here in a pixel, px: the nearest pixel contains the position; others count from centres, to the
  /// nearest phase.
  double shift() const { return count == 1 ? 0 : 0.5 - 0.5 / kPhases; }

  static const Taps& of(Filter filter);
};

}  // namespace nodal::view
