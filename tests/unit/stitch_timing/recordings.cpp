#include "recordings.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace nodal::timing::recordings {
namespace {

constexpr double kPi = std::numbers::pi;

/// Noise between 200 and 4500 Hz, a sum of windowed sincs of white noise: a filter of 129 taps.
std::vector<double> band_noise(std::size_t count, std::uint32_t seed) {
  constexpr int kHalf = 64;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> white(count + 2 * kHalf), band(count), taps;
  for (double& x : white) x = normal(random);
  for (int i = -kHalf; i <= kHalf; ++i) {
    const auto low_pass = [&](double hz) {
      return i == 0 ? 2 * hz / kSoundRate : std::sin(2 * kPi * hz / kSoundRate * i) / (kPi * i);
    };
    taps.push_back((low_pass(4500) - low_pass(200)) * (0.5 + 0.5 * std::cos(kPi * i / (kHalf + 1))));
  }
  for (std::size_t n = 0; n < count; ++n) {
    for (std::size_t k = 0; k < taps.size(); ++k) band[n] += taps[k] * white[n + k];
  }
  return band;
}

}  // namespace

double true_lag(const Clock& a, const Clock& b, double at) { return b.head_time(a.true_time(at)) - at; }
double true_rate(const Clock& a, const Clock& b) { return (1 + a.ppm * 1e-6) / (1 + b.ppm * 1e-6) - 1; }

double Sound::value(double time) const {
  constexpr int kHalf = 12;  // samples to each side: exact enough far below the sound's own rate
  const double place = (time - start) * kSoundRate;
  const auto whole = static_cast<std::int64_t>(std::floor(place));
  // sin(pi (place - k)) is the same for every k but for its sign.
  const double sine = std::sin(kPi * (place - static_cast<double>(whole))) / kPi;
  double sum = 0;
  for (std::int64_t k = whole - kHalf + 1; k <= whole + kHalf; ++k) {
    if (k < 0 || k >= static_cast<std::int64_t>(samples.size())) continue;
    const double x = place - static_cast<double>(k);
    const double sinc = std::abs(x) < 1e-9 ? 1.0 : ((whole - k) % 2 == 0 ? sine : -sine) / x;
    const double window = 1 - x * x / (kHalf * kHalf);
    sum += samples[static_cast<std::size_t>(k)] * sinc * window * window;
  }
  return sum;
}

Sound speech(double start, double seconds, std::uint32_t seed) {
  Sound sound{start, band_noise(static_cast<std::size_t>(seconds * kSoundRate), seed)};
  std::mt19937 random(seed + 1);
  std::uniform_real_distribution<double> phase(0, 2 * kPi);
  const double p1 = phase(random), p2 = phase(random);
  for (std::size_t i = 0; i < sound.samples.size(); ++i) {
    const double t = static_cast<double>(i) / kSoundRate;
    sound.samples[i] *= 0.3 * (1.1 + std::sin(2 * kPi * 2.3 * t + p1)) * (1.1 + std::sin(2 * kPi * 0.71 * t + p2));
  }
  return sound;
}

Sound loop_of(double start, double seconds, double period, std::uint32_t seed) {
  Sound sound{start, band_noise(static_cast<std::size_t>(seconds * kSoundRate), seed)};
  const auto every = static_cast<std::size_t>(std::lround(period * kSoundRate));
  for (std::size_t i = every; i < sound.samples.size(); ++i) sound.samples[i] = sound.samples[i - every];
  return sound;
}

Sound hum(double start, double seconds) {
  Sound sound{start, std::vector<double>(static_cast<std::size_t>(seconds * kSoundRate))};
  for (std::size_t i = 0; i < sound.samples.size(); ++i) {
    const double t = start + static_cast<double>(i) / kSoundRate;
    for (int k = 1; k <= 60; ++k) sound.samples[i] += 0.2 / k * std::sin(2 * kPi * 50 * k * t + k * k);
  }
  return sound;
}

std::vector<double> recorded(const Sound& sound, const Clock& clock, double rate, double seconds, double noise,
                             std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<double> samples(static_cast<std::size_t>(seconds * rate));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = sound.value(clock.true_time(static_cast<double>(i) / rate)) + normal(random);
  }
  return samples;
}

Shake::Shake(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0, 2 * kPi), share(0, 1);
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = 0; k < 10; ++k) {
      const double hertz = 0.3 * std::pow(20.0, share(random));
      waves_.push_back({axis, hertz, 0.4 * share(random) / std::sqrt(hertz), phase(random)});
    }
  }
}

Shake Shake::swing(double hertz) {
  Shake shake;
  shake.waves_ = {{0, hertz, 0.5, 0}, {1, hertz, 0.2, 1}};
  return shake;
}

double Shake::speed(double time) const {
  double rate[3] = {0, 0, 0};
  for (const Wave& wave : waves_) rate[wave.axis] += wave.size * std::sin(2 * kPi * wave.hertz * time + wave.phase);
  return std::sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
}

Rotation turned(const Shake& shake, const Clock& clock, double rate, double seconds, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  Rotation rotation;
  for (int i = 0; i < static_cast<int>(rate * seconds); ++i) {
    rotation.times.push_back(i / rate);
    rotation.speeds.push_back(std::abs(shake.speed(clock.true_time(i / rate)) + normal(random)));
  }
  return rotation;
}

Brightness filmed(const std::vector<double>& flashes, const Clock& clock, const Camera& camera, double seconds,
                  std::uint32_t seed) {
  constexpr int kSteps = 20;  // rows of the sensor in a band
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.3);
  Brightness film{{}, camera.rows, camera.readout, {}};
  for (int n = 0; n < static_cast<int>(seconds * camera.rate); ++n) {
    film.times.push_back(n / camera.rate);
    for (int r = 0; r < camera.rows; ++r) {
      double lit = 0;
      for (int k = 0; k < kSteps; ++k) {
        const double begin = film.times.back() + camera.readout * (r + (k + 0.5) / kSteps) / camera.rows;
        for (const double flash : flashes) {
          const double at = clock.head_time(flash);
          lit += (at >= begin && at < begin + camera.exposure ? 1.0 : 0.0) / kSteps;
        }
      }
      film.luma.push_back(80 + 20 * std::sin(0.1 * r) + 40 * lit + normal(random));
    }
  }
  return film;
}

}  // namespace nodal::timing::recordings
