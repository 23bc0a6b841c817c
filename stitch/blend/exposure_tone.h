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
/// Where numbers are a power of light, so are gains, and a change of light is undone exactly by multiplying numbers.
/// Where they are not (sRGB, polynomials), a curve takes them to light^(1 / 2.2), where gains act exactly too, and
/// `shown` takes the mixed light back.
struct ToneTable {
  struct Head {
    std::uint16_t exponent = 1 << 15;  ///< numbers ~ light^(exponent / 2^15)
    std::optional<ToneCurve> curve;
    friend bool operator==(const Head&, const Head&) = default;
  };
  std::vector<Head> heads;
  /// The sample that light^(1 / 2.2) is shown as, at 1 / 1024 of its range; empty when heads have no curves.
  std::vector<std::int16_t> shown;
  /// For raymaps of linear light, whose heads' numbers, or their curves, are all the same power of light: the light, in
  /// 1 / kWhite of what is shown white, that sRGB shows as each level, and how it would go on. Empty for others.
  std::vector<std::uint32_t> shown_light;
  static constexpr std::uint32_t kWhite = 1 << 20;
  static constexpr std::size_t kShownLevels = 8 * 255 + 1;  ///< three stops above the largest number
  /// Light above the raymap's range, as heads with a shorter exposure measured it: compressed so that all of it is
  /// shown (soften()), or clipped.
  bool soft = true;
};

struct ExposedHead {
  Stops exposure = 0;      ///< stops_of(shutter) + stops_of(gain)
  std::int32_t gamma = 0;  ///< thousandths; 0: as the table has it
};

/// Exposures that are closer than this are taken for the same: a two hundredth of light.
inline constexpr Stops kSameExposure = kStop / 128;
/// From this difference on, weights depend on the samples, so that a head that is not clipped outweighs one that is.
inline constexpr Stops kTrustDifference = kStop / 8;

/// A value that may reach up to `top` >= full, put under `full`: itself up to kSoftFromPercent of it, from there on rising less
/// and less (Reinhard's extended curve, which meets the straight part with its slope and `full` exactly at `top`).
/// Rises with `value`, and is `value` where top == full. All in the same unit, below 2^20.
std::int64_t soften(std::int64_t value, std::int64_t top, std::int64_t full);
inline constexpr std::int64_t kSoftFromPercent = 70;

/// The confidence in each head; nothing, where exposures are nearly equal. `by_luma`: only luma is available, not colours.
std::optional<Confidence> confidence_of(std::span<const ExposedHead> heads, bool by_luma);

/// The tone that shows every head as if it had been exposed like the mean of them; the table's calibrated_tone where
/// they were. Not for raymaps of linear light, see linear_tone.h. Allocates nothing.
SetTone tone_of_exposures(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads);

}  // namespace nodal::blend
