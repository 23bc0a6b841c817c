#include "stitch/timing/sound_track.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/timing/sinc.h"

namespace nodal::timing {
namespace {

constexpr int kMinRate = 11025, kMaxRate = 384000;
// The low-pass falls from 4 to 6 kHz: what is folded back lands above 4 kHz.
constexpr double kCutHz = 5000, kFallHz = 2000;
constexpr double kLowPassBeta = 5.65;  // 60 dB

}  // namespace

Result<SoundReducer> SoundReducer::make(int rate, std::shared_ptr<SoundStore> store) {
  if (rate < kMinRate || rate > kMaxRate) {
    return fail(
        Errc::kBadValue,
        fmt::format("sound with {} samples a second cannot be used for times; decode it with 11025 to 384000", rate));
  }
  return SoundReducer(rate, std::move(store));
}

SoundReducer::SoundReducer(int rate, std::shared_ptr<SoundStore> store)
    : rate_(rate),
      half_(static_cast<int>(std::ceil((60 - 8) / (2.285 * 2 * std::numbers::pi * kFallHz / rate) / 2)) + 1),
      phases_(kBandRate / std::gcd(rate, kBandRate)),
      weights_(),
      old_(static_cast<std::size_t>(half_), 0.0),
      old_start_(-half_),
      store_(std::move(store)) {
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

Status SoundReducer::add(std::span<const double> samples) {
  for (const double x : samples) old_.push_back(std::isfinite(x) ? std::clamp(x, -1e3, 1e3) : 0.0);
  return store_->append(whitener_.add(resampled()));
}

std::vector<float> SoundReducer::resampled() {
  std::vector<float> band;
  for (;; ++made_) {
    const std::int64_t place = made_ * rate_;  // samples / kBandRate
    const std::int64_t whole = place / kBandRate;
    const std::int64_t phase = place % kBandRate * phases_ / kBandRate;
    const std::int64_t first = whole - (half_ - 1) - old_start_;
    if (first + 2 * half_ > static_cast<std::int64_t>(old_.size())) break;
    const double* const weight = weights_.data() + phase * 2 * half_;
    const double* const sample = old_.data() + first;
    double sum = 0;
    for (int tap = 0; tap < 2 * half_; ++tap) sum += weight[tap] * sample[tap];
    band.push_back(static_cast<float>(sum));
  }
  const std::int64_t next = made_ * rate_ / kBandRate - (half_ - 1);
  const std::int64_t done = std::min(next - old_start_, static_cast<std::int64_t>(old_.size()));
  old_.erase(old_.begin(), old_.begin() + done);
  old_start_ += done;
  return band;
}

Result<SoundTrack> SoundReducer::finish(double start) && {
  const std::vector<double> zeros(static_cast<std::size_t>(half_), 0.0);
  NODAL_TRY(add(zeros));
  NODAL_TRY(store_->append(whitener_.finish()));
  return SoundTrack(start, made_, std::move(store_));
}

Result<std::vector<float>> SoundTrack::samples(std::int64_t first, std::int64_t count) const {
  const std::int64_t begin = std::clamp<std::int64_t>(first, 0, count_);
  const std::int64_t end = std::clamp<std::int64_t>(first + count, begin, count_);
  std::vector<float> samples(static_cast<std::size_t>(end - begin));
  if (!samples.empty()) NODAL_TRY(store_->read(begin, samples));
  return samples;
}

Status MemoryStore::append(std::span<const float> samples) {
  samples_.insert(samples_.end(), samples.begin(), samples.end());
  return {};
}

Status MemoryStore::read(std::int64_t first, std::span<float> into) const {
  std::copy_n(samples_.begin() + first, into.size(), into.begin());
  return {};
}

}  // namespace nodal::timing
