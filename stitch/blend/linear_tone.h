// Computes, from a set's exposures, the tone of its linear-light raymap and the scale of that raymap's numbers.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/stops.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::blend {

/// Numbers are proportional to light: 0 is none, and 65535 the most that the raymap can hold, which is the light that fills
/// a sample of the head with the least exposure, at the darkest place of its lens. No head's measurement is clipped or
/// compressed. So the light of 65535 depends on the exposures, and is reported with every set.
struct LinearScale {
  /// The exposure by which the light of 65535 just fills a head's sample; nothing where exposures are not known.
  std::optional<Stops> full;
  /// The least number that a picture of 8 bits shows as each level: sRGB, white what fills the sample of a head exposed
  /// like the mean of all, highlights held back as ToneTable::soft says.
  std::array<std::uint16_t, 256> shown_from{};
};

/// The tone that converts every head's numbers to the light of the raymap's scale. Allocates nothing.
SetTone linear_tone(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads);

/// The scale of that tone.
LinearScale linear_scale(const ToneTable& tones, const SetTone& tone, std::span<const ExposedHead> heads);

}  // namespace nodal::blend
