#include "firmware/sync/rate_in_force.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace nodal::firmware {
namespace {

constexpr std::int64_t kBillion = 1'000'000'000;

std::int64_t distance_ppb(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<__int128>(std::abs(a - b)) * kBillion / std::max<std::int64_t>(1, b));
}

}  // namespace

std::optional<FrameRate> rate_with_period(Duration period, std::int64_t ppb) {
  // Convergents of the continued fraction of 1e9 / period.
  std::int64_t above = kBillion, below = period.ns();
  std::int64_t n0 = 0, n1 = 1, d0 = 1, d1 = 0;
  while (below > 0) {
    const std::int64_t whole = above / below;
    const std::int64_t n = whole * n1 + n0, d = whole * d1 + d0;
    if (n > FrameRate::kMaxTerm || d > FrameRate::kMaxTerm) return std::nullopt;
    n0 = std::exchange(n1, n), d0 = std::exchange(d1, d);
    above = std::exchange(below, above % below);
    const auto rate =
        n > 0 ? FrameRate::make(static_cast<std::uint64_t>(n), static_cast<std::uint64_t>(d)) : std::nullopt;
    if (rate && distance_ppb(rate->period().ns(), period.ns()) <= ppb) return rate;
  }
  return std::nullopt;
}

void RateInForce::restart(FrameRate commanded) {
  commanded_ = rate_ = commanded;
  newest_.reset();
  count_ = 0;
}

std::optional<Duration> RateInForce::measured() const {
  std::array<std::int64_t, kSteps> sorted = steps_;
  const auto middle = sorted.begin() + kSteps / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  std::int64_t sum = 0, used = 0;
  for (const std::int64_t step : steps_) {
    if (std::abs(step - *middle) > *middle / 4) continue;
    sum += step;
    ++used;
  }
  if (used < static_cast<std::int64_t>(kSteps) * 3 / 4) return std::nullopt;
  return Duration::nanoseconds(sum / used);
}

void RateInForce::add(Instant middle, std::optional<std::int32_t> drift_ppb) {
  const auto before = std::exchange(newest_, middle);
  if (!before || middle <= *before) return;
  constexpr std::int64_t kLongest = 1'000'000 * kBillion;  // so that sums fit
  steps_[count_++ % kSteps] = std::min((middle - *before).ns(), kLongest);
  if (count_ % kSteps != 0) return;
  const auto step = measured();
  if (!step) return;
  constexpr std::int64_t kOther = 5'000'000, kMeasured = 300'000;  // ppb; the second: what the mean of 64 may be off
  const std::int64_t period = commanded_.period().ns();
  if (distance_ppb(step->ns(), period) > kOther) {
    if (distance_ppb(step->ns(), rate_.period().ns()) > kOther)
      rate_ = rate_with_period(*step, kMeasured).value_or(rate_);
    return;
  }
  rate_ = commanded_;
  if (!drift_ppb || std::abs(*drift_ppb) <= kExactPpb) return;
  const auto drifted = static_cast<std::int64_t>(static_cast<__int128>(period) * (kBillion + *drift_ppb) / kBillion);
  rate_ = rate_with_period(Duration::nanoseconds(drifted), 1'000).value_or(commanded_);
}

}  // namespace nodal::firmware
