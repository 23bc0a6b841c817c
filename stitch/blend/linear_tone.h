// A set's exposures become the tone of its raymap of linear light, and what that raymap's numbers stand for.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/stops.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::blend {

/// Numbers are proportional to light: 0 is none, and 65535 the most that the raymap can hold, which is what fills the
/// sample of the head that is exposed least, where its lens lets least through. Nothing that a head saw is clipped, and
/// nothing held back. So what 65535 stands for goes with the exposures, and is told with every set.
struct LinearScale {
  /// The exposure by which the light of 65535 just fills a head's sample; nothing where exposures are not known.
  std::optional<Stops> full;
  /// The least number that a picture of 8 bits shows as each level: sRGB, white what fills the sample of a head exposed
  /// like the mean of all, highlights held back as ToneTable::soft says.
  std::array<std::uint16_t, 256> shown_from{};
};

/// The tone that takes every head's numbers to the light that the raymap's numbers stand for. Allocates nothing.
SetTone linear_tone(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads);

/// Of that tone.
LinearScale linear_scale(const ToneTable& tones, const SetTone& tone, std::span<const ExposedHead> heads);

}  // namespace nodal::blend
