// How a raymap says which exposure its white has.
#pragma once

#include <algorithm>
#include <cstdint>

#include "protocol/base/stops.h"

namespace nodal::sets {

/// For metadata: the exposure, at no gain, that white stands for, in ns; `full` is in stops of a microsecond. What is
/// beyond any camera is limited, so that it fits the field.
inline std::uint64_t full_exposure_ns(Stops full) { return exp2_stops(std::clamp(full, -9 * kStop, 40 * kStop), 1000); }

}  // namespace nodal::sets
