// What a simulated head is like.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/head.h"
#include "hal/sim/scene/sensor.h"

namespace nodal::hal::sim {

/// How often each random fault occurs, in frames per million.
struct HeadFaults {
  std::uint32_t lose = 0, corrupt = 0, tear = 0, delay = 0, duplicate = 0;
  Duration longest_delay = Duration::milliseconds(20);
};

HeadLimits default_head_limits();

inline constexpr std::uint16_t kWhiteBalanceMin = 256;  ///< a sixteenth

struct HeadOptions {
  PixelFormat pixels = PixelFormat::kI420;  ///< YUV is full range BT.601, as in JPEG
  FrameRate rate;
  /// An interlaced head exposes two fields half a period apart; its height must be a multiple of four.
  Fields fields = Fields::kProgressive;
  HeadLimits limits = default_head_limits();
  HeadSettings settings;                                ///< at power-on
  Exposure reference = Exposure::microseconds(10'000);  ///< light 1 fills a pixel with this exposure and 0 dB
  int supersampling = 2;                                ///< n x n samples per pixel
  NoiseModel noise;
  int buffers = 4;
  Duration trigger_latency = Duration::microseconds(20);  ///< from a pulse to the start of the exposure
  Duration trigger_jitter = Duration::microseconds(2);    ///< per pulse, uniform in both directions
  Duration stamp_jitter;                          ///< error of the reported mid_exposure, uniform in both directions
  Duration readout = Duration::milliseconds(12);  ///< from the end of the exposure to the last byte
  std::int32_t free_run_drift_ppm = 0;            ///< positive is slow; at most 100 000 either way
  std::optional<Duration> free_run_phase;         ///< time from start() to the first exposure; random if not given
  HeadFaults faults;
};

/// The subset of the options that the sensor needs. The sensor of a head that delivers MJPEG delivers I420.
SensorOptions sensor_options(const HeadOptions& options);

}  // namespace nodal::hal::sim
