// CLOCK_MONOTONIC as the rig's clock: V4L2's timestamps use it.
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
