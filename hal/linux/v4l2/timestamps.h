// What a driver's timestamp says about the exposure.
#pragma once

#include <cstdint>

#include "protocol/base/units.h"

namespace nodal::hal::v4l2 {

struct FrameTimes {
  Instant mid_exposure;
  Instant received;
};

/// Of a buffer whose v4l2_buffer::flags are `flags` and that was dequeued at `now`. A timestamp at the start of exposure
/// is half an exposure before its middle; one at the end of frame, or at no known point, is `readout` and half an
/// exposure after it. Clocks other than CLOCK_MONOTONIC are not read: such a frame ended when it was dequeued.
/// mid_exposure <= received <= now, whatever the driver says.
FrameTimes times_of(std::uint32_t flags, Instant timestamp, Instant now, Exposure exposure, Duration readout);

}  // namespace nodal::hal::v4l2
