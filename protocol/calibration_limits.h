// How large a calibration may be.
#pragma once

#include <cstddef>

namespace nodal {

/// Heads of a document. A rig's board blends at most kMaxHeads; pictures in files may be of more.
inline constexpr std::size_t kMaxCalibratedHeads = 64;

}  // namespace nodal
