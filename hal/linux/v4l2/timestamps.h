// Derives the time of an exposure from a driver's timestamp.
#pragma once

#include <cstdint>

#include "protocol/base/units.h"

namespace nodal::hal::v4l2 {

struct FrameTimes {
  Instant mid_exposure;
  Instant received;
};

/// Times of a buffer with the v4l2_buffer::flags `flags`, dequeued at `now`. A timestamp at the start of exposure is
/// half an exposure before its middle; one at the end of the frame, or at an unknown point, is `readout` and half an
/// exposure after it. Timestamps of other clocks than CLOCK_MONOTONIC are not used: such a frame counts as ended when
/// dequeued. mid_exposure <= received <= now, whatever the driver reports.
FrameTimes times_of(std::uint32_t flags, Instant timestamp, Instant now, Exposure exposure, Duration readout);

}  // namespace nodal::hal::v4l2
