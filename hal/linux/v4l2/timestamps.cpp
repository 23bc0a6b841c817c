#include "hal/linux/v4l2/timestamps.h"

#include <linux/videodev2.h>

#include <algorithm>

namespace nodal::hal::v4l2 {

FrameTimes times_of(std::uint32_t flags, Instant timestamp, Instant now, Exposure exposure, Duration readout) {
  const Duration half = exposure.duration() / 2;
  const bool monotonic = (flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  const bool at_start = monotonic && (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  if (!monotonic) timestamp = now;
  FrameTimes times;
  times.received = at_start ? now : std::min(timestamp, now);
  times.mid_exposure = at_start ? timestamp + half : timestamp - readout - half;
  times.mid_exposure = std::min(times.mid_exposure, times.received);
  return times;
}

}  // namespace nodal::hal::v4l2
