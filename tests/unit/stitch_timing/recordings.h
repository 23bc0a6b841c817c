// Recordings of one event by heads whose clocks differ, computed from functions of true time.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/timing/flash_lag.h"
#include "stitch/timing/rotation_lag.h"

namespace nodal::timing::recordings {

/// A head's clock: true time = offset + (1 + ppm / 1e6) * head time.
struct Clock {
  double offset = 0;  ///< s
  double ppm = 0;
  double true_time(double head) const { return offset + (1 + ppm * 1e-6) * head; }
  double head_time(double truth) const { return (truth - offset) / (1 + ppm * 1e-6); }
};

/// The lag from a to b at a's time `at`, and its rate.
double true_lag(const Clock& a, const Clock& b, double at);
double true_rate(const Clock& a, const Clock& b);

/// Sound in true time, -1 .. 1: values at 40 kHz from `start` on, read between them by a long windowed sinc of its own.
struct Sound {
  double start = 0;
  std::vector<double> samples{};
  double value(double time) const;
};
inline constexpr double kSoundRate = 40000;

/// Speech-like sound: noise below 4.5 kHz, louder and quieter several times a second.
Sound speech(double start, double seconds, std::uint32_t seed);
/// The same second over and over.
Sound loop_of(double start, double seconds, double period, std::uint32_t seed);
/// 50 Hz and its harmonics.
Sound hum(double start, double seconds);

/// What a head records of `sound` by its own clock in seconds 0 .. `seconds`, with white noise of its own.
std::vector<double> recorded(const Sound& sound, const Clock& clock, double rate, double seconds, double noise,
                             std::uint32_t seed);

/// A rig's rotation about three axes, a sum of waves from 0.3 to 6 Hz with amplitudes of a hand's shake.
class Shake {
 public:
  explicit Shake(std::uint32_t seed);
  static Shake still() { return Shake(); }
  /// Two axes swing with this frequency.
  static Shake swing(double hertz);
  /// rad/s at a true time.
  double speed(double time) const;

 private:
  struct Wave {
    int axis;
    double hertz, size, phase;
  };
  Shake() = default;
  std::vector<Wave> waves_{};
};

/// The speed that a head measures `rate` times a second by its own clock, with noise, rad/s.
Rotation turned(const Shake& shake, const Clock& clock, double rate, double seconds, double noise, std::uint32_t seed);

struct Camera {
  double rate = 30;        ///< frames a second
  int rows = 60;           ///< bands whose brightness is known
  double readout = 0.016;  ///< s
  double exposure = 0.03;  ///< one row's, s
};

/// The brightness of a film, with noise, in which short flashes happen at true times.
Brightness filmed(const std::vector<double>& flashes, const Clock& clock, const Camera& camera, double seconds,
                  std::uint32_t seed);

}  // namespace nodal::timing::recordings
