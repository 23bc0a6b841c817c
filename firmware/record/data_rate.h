// What the sets of a take need of the disk.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "firmware/record/recorder.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

struct DataRate {
  FrameRate rate;
  std::uint64_t expected_set_bytes = 0;  ///< by the heads' formats

  /// Bytes that the heads deliver in a second, by their formats and by the newest recorded set.
  std::uint64_t bytes_a_second(const Recorder& recorder) const {
    const std::uint64_t newest = recorder.counts().set_bytes.load(std::memory_order_relaxed);
    return std::max(newest, expected_set_bytes) * rate.numerator / rate.denominator;
  }
};

}  // namespace nodal::firmware
