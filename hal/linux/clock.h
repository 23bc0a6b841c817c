// CLOCK_MONOTONIC as the rig's clock: what V4L2 stamps its frames with.
#pragma once

#include "hal/clock.h"

namespace nodal::hal::linux_os {

/// Threading: thread-safe.
/// Ownership: none.
/// Errors: none.
class LinuxClock final : public ClockPort {
 public:
  Instant now() override;
};

}  // namespace nodal::hal::linux_os
