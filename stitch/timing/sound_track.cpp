#include "stitch/timing/sound_track.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "stitch/timing/fourier.h"
#include "stitch/timing/sinc.h"

namespace nodal::timing {
namespace {

constexpr int kMinRate = 11025, kMaxRate = 384000;
constexpr double kLowHz = 300, kHighHz = 4000;
// The low-pass falls from 4 to 6 kHz: what is folded back lands above 4 kHz.
constexpr double kCutHz = 5000, kFallHz = 2000;
constexpr double kLowPassBeta = 5.65;  // 60 dB
constexpr std::size_t kFrame = 4096, kHop = kFrame / 2;
constexpr double kSilent = 1e-4;  // root mean square in the band: -80 dB

}  // namespace

Result<SoundReducer> SoundReducer::make(int rate) {
  if (rate < kMinRate || rate > kMaxRate) {
    return fail(
        Errc::kBadValue,
        fmt::format("sound with {} samples a second cannot be used for times; decode it with 11025 to 384000", rate));
  }
  return SoundReducer(rate);
}

SoundReducer::SoundReducer(int rate)
    : rate_(rate),
      half_(static_cast<int>(std::ceil((60 - 8) / (2.285 * 2 * std::numbers::pi * kFallHz / rate) / 2)) + 1),
      phases_(kBandRate / std::gcd(rate, kBandRate)),
      weights_(),
      old_(static_cast<std::size_t>(half_), 0.0),
      old_start_(-half_),
      band_() {
  weights_.reserve(static_cast<std::size_t>(phases_) * 2 * static_cast<std::size_t>(half_));
  for (std::int64_t phase = 0; phase < phases_; ++phase) {
    for (int tap = 0; tap < 2 * half_; ++tap) {
      const double x = tap - (half_ - 1) - static_cast<double>(phase) / static_cast<double>(phases_);
      const double angle = 2 * std::numbers::pi * kCutHz / rate * x;
      const double sinc = angle == 0 ? 1.0 : std::sin(angle) / angle;
      weights_.push_back(2 * kCutHz / rate * sinc * kaiser(x / half_, kLowPassBeta));
    }
  }
}

void SoundReducer::add(std::span<const double> samples) {
  for (const double x : samples) old_.push_back(std::isfinite(x) ? std::clamp(x, -1e3, 1e3) : 0.0);
  resample();
}

void SoundReducer::resample() {
  for (;;) {
    const std::int64_t place = static_cast<std::int64_t>(band_.size()) * rate_;  // samples / kBandRate
    const std::int64_t whole = place / kBandRate;
    const std::int64_t phase = place % kBandRate * phases_ / kBandRate;
    const std::int64_t first = whole - (half_ - 1) - old_start_;
    if (first + 2 * half_ > static_cast<std::int64_t>(old_.size())) break;
    const double* const weight = weights_.data() + phase * 2 * half_;
    const double* const sample = old_.data() + first;
    double sum = 0;
    for (int tap = 0; tap < 2 * half_; ++tap) sum += weight[tap] * sample[tap];
    band_.push_back(static_cast<float>(sum));
  }
  const std::int64_t next = static_cast<std::int64_t>(band_.size()) * rate_ / kBandRate - (half_ - 1);
  const std::int64_t done = std::min(next - old_start_, static_cast<std::int64_t>(old_.size()));
  old_.erase(old_.begin(), old_.begin() + done);
  old_start_ += done;
}

SoundTrack SoundReducer::finish(double start) && {
  const std::vector<double> zeros(static_cast<std::size_t>(half_), 0.0);
  add(zeros);
  whiten(band_);
  return {start, std::move(band_)};
}

void whiten(std::vector<float>& band) {
  Fourier fourier(kFrame);
  std::vector<double> window(kFrame), frame(kFrame);
  for (std::size_t i = 0; i < kFrame; ++i) {
    window[i] = std::sin(std::numbers::pi * (static_cast<double>(i) + 0.5) / kFrame);
  }
  const std::size_t low = static_cast<std::size_t>(std::ceil(kLowHz * kFrame / kBandRate));
  const std::size_t high = static_cast<std::size_t>(std::floor(kHighHz * kFrame / kBandRate));
  std::vector<float> white(band.size() + kFrame, 0.0F);
  // Frame f covers samples (f - 1) kHop .. (f + 1) kHop, so that two frames cover every sample.
  for (std::size_t f = 0; f * kHop < band.size() + kHop; ++f) {
    for (std::size_t i = 0; i < kFrame; ++i) {
      const std::size_t at = f * kHop + i;
      frame[i] = at < kHop || at - kHop >= band.size() ? 0.0 : window[i] * static_cast<double>(band[at - kHop]);
    }
    auto spectrum = fourier.forward(frame);
    double power = 0;
    for (std::size_t k = 0; k < spectrum.size(); ++k) {
      if (k < low || k > high) spectrum[k] = 0;
      else power += std::norm(spectrum[k]);
    }
    // Parseval, with the window's mean square of 1/2: mean square of the samples = 4 power / length^2.
    if (4 * power < kSilent * kSilent * kFrame * kFrame) continue;
    for (std::size_t k = low; k <= high; ++k) {
      const double size = std::abs(spectrum[k]);
      spectrum[k] = size > 0 ? spectrum[k] / size : 0.0;
    }
    const std::vector<double> samples = fourier.inverse(spectrum);
    for (std::size_t i = 0; i < kFrame; ++i) {
      const std::size_t at = f * kHop + i;
      if (at >= kHop && at - kHop < band.size()) white[at - kHop] += static_cast<float>(window[i] * samples[i]);
    }
  }
  white.resize(band.size());
  band = std::move(white);
}

}  // namespace nodal::timing
