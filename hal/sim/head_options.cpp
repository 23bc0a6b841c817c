#include "hal/sim/head_options.h"

namespace nodal::hal::sim {

SensorOptions sensor_options(const HeadOptions& options) {
  return {options.pixels == PixelFormat::kMjpeg ? PixelFormat::kI420 : options.pixels,
          options.fields != Fields::kProgressive,
          options.rate.period() / 2,
          options.reference,
          options.supersampling,
          options.noise};
}

HeadLimits default_head_limits() {
  HeadLimits limits;
  limits.exposure_min = Exposure::microseconds(10);
  limits.exposure_max = Exposure::microseconds(33'000);
  limits.gain_min = Gain::millidecibels(0);
  limits.gain_max = Gain::millidecibels(24'000);
  limits.gamma_min = Gamma::thousandths(1000);
  limits.gamma_max = Gamma::thousandths(3000);
  limits.has_white_balance = true;
  limits.has_trigger_input = true;
  limits.control_latency_frames = 2;
  limits.nudge = {Duration::microseconds(25), Duration::milliseconds(-2), Duration::milliseconds(4), 2};
  return limits;
}

}  // namespace nodal::hal::sim
