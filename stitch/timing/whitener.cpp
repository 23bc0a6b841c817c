#include "stitch/timing/whitener.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "stitch/timing/sound_track.h"

namespace nodal::timing {
namespace {

constexpr double kLowHz = 300, kHighHz = 4000;
constexpr std::size_t kFrame = 4096, kHop = kFrame / 2;
constexpr double kSilent = 1e-4;  // root mean square in the band: -80 dB

}  // namespace

Whitener::Whitener() : fourier_(kFrame), window_(kFrame), waiting_(kHop, 0.0F), sum_(kFrame, 0.0F) {
  for (std::size_t i = 0; i < kFrame; ++i) {
    window_[i] = std::sin(std::numbers::pi * (static_cast<double>(i) + 0.5) / kFrame);
  }
}

/// Frame f covers samples (f - 1) kHop .. (f + 1) kHop, so that two frames cover every sample.
void Whitener::add_frame() {
  const std::size_t low = static_cast<std::size_t>(std::ceil(kLowHz * kFrame / kBandRate));
  const std::size_t high = static_cast<std::size_t>(std::floor(kHighHz * kFrame / kBandRate));
  std::vector<double> frame(kFrame);
  for (std::size_t i = 0; i < kFrame; ++i) frame[i] = window_[i] * static_cast<double>(waiting_[i]);
  waiting_.erase(waiting_.begin(), waiting_.begin() + kHop);
  auto spectrum = fourier_.forward(frame);
  double power = 0;
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    if (k < low || k > high) spectrum[k] = 0;
    else power += std::norm(spectrum[k]);
  }
  // Parseval, with the window's mean square of 1/2: mean square of the samples = 4 power / length^2.
  if (4 * power >= kSilent * kSilent * kFrame * kFrame) {
    for (std::size_t k = low; k <= high; ++k) {
      const double size = std::abs(spectrum[k]);
      spectrum[k] = size > 0 ? spectrum[k] / size : 0.0;
    }
    const std::vector<double> samples = fourier_.inverse(spectrum);
    for (std::size_t i = 0; i < kFrame; ++i) sum_[i] += static_cast<float>(window_[i] * samples[i]);
  }
  if (!first_) ready_.insert(ready_.end(), sum_.begin(), sum_.begin() + kHop);
  first_ = false;
  std::copy(sum_.begin() + kHop, sum_.end(), sum_.begin());
  std::fill(sum_.begin() + kHop, sum_.end(), 0.0F);
}

std::vector<float> Whitener::add(std::span<const float> samples) {
  added_ += static_cast<std::int64_t>(samples.size());
  waiting_.insert(waiting_.end(), samples.begin(), samples.end());
  while (waiting_.size() >= kFrame) add_frame();
  std::vector<float> ready;
  ready.swap(ready_);
  given_ += static_cast<std::int64_t>(ready.size());
  return ready;
}

std::vector<float> Whitener::finish() {
  const auto rest = static_cast<std::size_t>(added_ - given_);
  while (ready_.size() < rest) {
    if (waiting_.size() < kFrame) waiting_.resize(kFrame, 0.0F);
    add_frame();
  }
  ready_.resize(rest);
  given_ = added_;
  return std::move(ready_);
}

}  // namespace nodal::timing
