// Sleeping for links and all other ports at once.
#pragma once

#include "hal/wake_ups.h"
#include "protocol/base/units.h"

namespace nodal::hal {

/// Sleeps until one of the descriptors or the time wakes it, a signal comes, or `at_most` has passed. `now` is the time
/// of the clock that the time belongs to. Returns whether a descriptor ended the sleep.
bool wait_for(const WakeUps& wake_ups, Instant now, Duration at_most);

}  // namespace nodal::hal
