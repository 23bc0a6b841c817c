// Compensates different exposures of the heads: computes the blend's tone from a set's exposures.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/stops.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/tone.h"

namespace nodal::blend {

/// The heads' response to light. Made by stitch/table off the hot path.
///
/// Where sample values are a power of light, so are gains: multiplying the values compensates a change of exposure
/// exactly. Where they are not (sRGB, polynomials), a curve converts them to light^(1 / 2.2), where gains are exact
/// too, and `shown` converts the blended light back.
struct ToneTable {
  struct Head {
    std::uint16_t exponent = 1 << 15;  ///< sample values are ~ light^(exponent / 2^15)
    std::optional<ToneCurve> curve;
    friend bool operator==(const Head&, const Head&) = default;
  };
  std::vector<Head> heads;
  /// The sample that light^(1 / 2.2) is shown as, at every 1/1024 of its range; empty if no head has a curve.
  std::vector<std::int16_t> shown;
  /// Only for raymaps of linear light, where all heads' values (after their curves) are the same power of light: for
  /// each level, the light that sRGB shows as that level, in 1 / kWhite of shown white; continued above level 255.
  std::vector<std::uint32_t> shown_light;
  static constexpr std::uint32_t kWhite = 1 << 20;
  static constexpr std::size_t kShownLevels = 8 * 255 + 1;  ///< up to three stops above level 255
  /// What happens to light above the raymap's range, which heads with a shorter exposure measure: true: it is
  /// compressed so that all of it is shown (soften()); false: it is clipped.
  bool soft = true;
};

struct ExposedHead {
  Stops exposure = 0;      ///< stops_of(shutter) + stops_of(gain)
  std::int32_t gamma = 0;  ///< thousandths; 0: the calibrated response
};

/// Exposures closer than this count as equal: about 0.5 % of light.
inline constexpr Stops kSameExposure = kStop / 128;
/// From this difference on, weights depend on the samples, so that an unclipped head outweighs a clipped one.
inline constexpr Stops kTrustDifference = kStop / 8;

/// Compresses a value that can reach `top` >= `full` to at most `full`: unchanged up to kSoftFromPercent of `full`,
/// then with decreasing slope (Reinhard's extended curve; it continues the straight part's slope and reaches `full`
/// exactly at `top`). Increasing in `value`; equal to `value` if top == full. All in the same unit, below 2^20.
std::int64_t soften(std::int64_t value, std::int64_t top, std::int64_t full);
inline constexpr std::int64_t kSoftFromPercent = 70;

/// The confidence in each head; nothing if exposures are nearly equal. `by_luma`: only luma is available, not colours.
std::optional<Confidence> confidence_of(std::span<const ExposedHead> heads, bool by_luma);

/// The tone that shows every head as if it had the heads' mean exposure; the table's calibrated_tone if all exposures
/// are equal. Not for raymaps of linear light, see linear_tone.h. Allocates nothing.
SetTone tone_of_exposures(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads);

}  // namespace nodal::blend
