#include "firmware/sync/drift.h"

#include <algorithm>
#include <cstdlib>

namespace nodal::firmware {
namespace {

/// The largest distance from the nominal grid, eleven days: the sums of a block stay far below 2^63.
constexpr std::int64_t kFarthest = 1'000'000'000'000'000;

}  // namespace

void DriftMeter::restart(FrameRate rate) {
  rate_ = rate;
  started_ = false;
  filling_ = {};
  full_ = 0;
}

void DriftMeter::add(std::int64_t number, Instant at) {
  if (started_ && number < first_number_) return;
  const std::int64_t from_first = started_ ? number - first_number_ : 0;
  std::int64_t distance = 0;
  if (started_) {
    distance = (at - first_at_ - rate_.start_of(static_cast<std::uint64_t>(from_first))).ns();
    if (std::abs(distance - last_distance_) > rate_.period().ns() / 2 || std::abs(distance) > kFarthest) {
      restart(rate_);
      return add(number, at);
    }
  } else {
    started_ = true;
    first_number_ = number;
    first_at_ = at;
    filling_since_ = 0;
  }
  last_distance_ = distance;
  if (from_first - filling_since_ >= kBlockPeriods) {
    blocks_[full_++ % kBlocks] = filling_;
    filling_ = {};
    filling_since_ = from_first;
  }
  ++filling_.moments;
  filling_.numbers += from_first;
  filling_.distances += distance;
}

DriftMeter::Mean DriftMeter::mean(std::size_t from, std::size_t count) const {
  Block sum;
  for (std::size_t age = from; age < from + count; ++age) {
    sum.moments += block(age).moments;
    sum.numbers += block(age).numbers;
    sum.distances += block(age).distances;
  }
  return {sum.numbers / sum.moments, sum.distances / sum.moments};
}

std::optional<std::int32_t> DriftMeter::ppb() const {
  const std::size_t kept = std::min(full_, kBlocks);
  if (kept < 2) return std::nullopt;
  const Mean newer = mean(0, kept / 2);
  const Mean older = mean(kept - kept / 2, kept / 2);
  const std::int64_t span = rate_.start_of(static_cast<std::uint64_t>(newer.number - older.number)).ns();
  if (span <= 0) return std::nullopt;
  constexpr std::int64_t kBillion = 1'000'000'000;
  // ns: a billion times as much fits 64 bits, and no clock drifts this far in 17 s.
  constexpr std::int64_t kMax = 8 * kBillion;
  const std::int64_t ppb = std::clamp(newer.distance - older.distance, -kMax, kMax) * kBillion / span;
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(ppb, -kBillion, kBillion));
}

}  // namespace nodal::firmware
