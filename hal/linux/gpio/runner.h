// The threads that drive GPIO lines on this machine.
#pragma once

#include "hal/linux/gpio/system.h"

namespace nodal::hal::gpio {

/// CLOCK_MONOTONIC: the clock of the kernel's edge timestamps from Linux 5.7 on.
Instant monotonic_now();

/// With RunOptions::realtime the thread sleeps to absolute times with the precision of the kernel's timers, and runs
/// with SCHED_FIFO where that is permitted. Otherwise it sleeps in poll() until a line has events.
/// Throws std::system_error when the system refuses a thread.
Running run_on_thread(const RunOptions& options, Step step);

}  // namespace nodal::hal::gpio
