#include "firmware/daemon/drivers.h"

#include "firmware/daemon/log.h"
#include "hal/linux/clock.h"
#include "hal/linux/gpio/traced_system.h"
#include "hal/linux/iidc/traced_bus.h"
#include "hal/linux/v4l2/traced_system.h"

namespace nodal::daemon {
namespace {

hal::ClockPort& machine_clock() {
  static hal::linux_os::LinuxClock clock;
  return clock;
}

hal::TraceLine writer(LogCategory category) {
  return [category](const std::string& line) { log_line(category, LogLevel::kTrace, line); };
}

}  // namespace

hal::v4l2::System& v4l2_drivers() {
  if (!logs(LogCategory::kV4l2, LogLevel::kTrace)) return hal::v4l2::kernel();
  // Not destroyed, because a thread that a device has hung may still use it when the process ends.
  static auto* const traced =
      new hal::v4l2::TracedSystem(hal::v4l2::kernel(), machine_clock(), writer(LogCategory::kV4l2));
  return *traced;
}

hal::iidc::Bus& iidc_cameras() {
  if (!logs(LogCategory::kIidc, LogLevel::kTrace)) return hal::iidc::cameras();
  static auto* const traced =
      new hal::iidc::TracedBus(hal::iidc::cameras(), machine_clock(), writer(LogCategory::kIidc));
  return *traced;
}

hal::gpio::System& gpio_chips() {
  if (!logs(LogCategory::kGpio, LogLevel::kTrace)) return hal::gpio::kernel();
  static auto* const traced = new hal::gpio::TracedSystem(hal::gpio::kernel(), writer(LogCategory::kGpio));
  return *traced;
}

}  // namespace nodal::daemon
