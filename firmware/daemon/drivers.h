// The drivers of this machine, as nodald calls them: traced when the log asks for it (`nodald --log v4l2=trace`).
#pragma once

#include "hal/linux/gpio/system.h"
#include "hal/linux/iidc/bus.h"
#include "hal/linux/v4l2/system.h"

namespace nodal::daemon {

/// The kernel's or libdc1394's own; or, with a trace, a system that passes each call on and writes a line about it.
/// Call them after start_log(), which sets the levels. They live as long as the process.
hal::v4l2::System& v4l2_drivers();
hal::iidc::Bus& iidc_cameras();
hal::gpio::System& gpio_chips();

}  // namespace nodal::daemon
