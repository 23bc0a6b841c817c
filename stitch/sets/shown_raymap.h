// Raymaps of linear light as people see them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/blend/linear_tone.h"

namespace nodal::sets {

/// Maps 16-bit raymaps to 8 bits.
///
/// Threading: thread-bound.
/// Ownership: owns the converted picture, which is valid until the next call. Its memory is allocated by the first one.
/// Errors: none.
class ShownRaymap {
 public:
  ShownRaymap();
  /// The raymap itself if it has 8 bits. Without a scale, the newest one is used.
  ImageView in_8_bits(const ImageView& raymap, const std::optional<blend::LinearScale>& scale);

 private:
  void set_levels(const blend::LinearScale& scale);

  std::vector<std::uint8_t> picture_;
  std::vector<std::uint8_t> level_of_;           ///< lookup table: 16-bit value to 8-bit level
  std::array<std::uint16_t, 256> shown_from_{};  ///< the scale that level_of_ was computed from
};

}  // namespace nodal::sets
