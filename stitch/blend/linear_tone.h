// Computes, from a set's exposures, the tone of its linear-light raymap and the scale of that raymap's numbers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/stops.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::blend {

/// Numbers are proportional to light: 0 is no light; 65535 is the largest light that the raymap can hold: the light
/// that fills a sample of the head with the shortest exposure, at the darkest part of its lens. No head's measurement
/// is clipped or compressed. So the light of 65535 depends on the exposures, and is reported with every set.
struct LinearScale {
  /// The exposure at which the light of 65535 just fills a head's sample; nothing if exposures are not known.
  std::optional<Stops> full;
  /// The smallest number that an 8-bit picture shows as each level: sRGB; white is the light that fills a sample of a
  /// head with the mean exposure; highlights are compressed or clipped according to ToneTable::soft.
  std::array<std::uint16_t, 256> shown_from{};
};

/// The tone that converts every head's values to the light of the raymap's scale. Allocates nothing.
SetTone linear_tone(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads);

/// The scale of that tone.
LinearScale linear_scale(const ToneTable& tones, const SetTone& tone, std::span<const ExposedHead> heads);

}  // namespace nodal::blend
