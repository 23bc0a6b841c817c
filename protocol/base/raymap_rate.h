// How often raymaps come.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal {

/// The rate of raymaps: one of each set, or one of each field. Nothing if it is above what a FrameRate can be.
constexpr std::optional<FrameRate> raymap_rate(FrameRate sets, int raymaps_a_set) {
  return FrameRate::make(std::uint64_t{sets.numerator} * static_cast<std::uint64_t>(std::max(1, raymaps_a_set)),
                         sets.denominator);
}

}  // namespace nodal
