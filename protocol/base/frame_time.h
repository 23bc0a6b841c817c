// Deadlines that mean "some frames".
#pragma once

#include <algorithm>

#include "protocol/base/units.h"

namespace nodal {

/// A time in which some frames must have come, whatever the rate: so many periods of the rate in force, but at least
/// `least`, because a fast rig's threads and links may be late as well. Rates from one frame in 1000 s to 1000 a second
/// are allowed, so a plain Duration is never right for this.
struct FrameTime {
  Duration least;
  int periods = 0;

  constexpr Duration at(Duration period) const { return std::max(least, period * periods); }
};

}  // namespace nodal
