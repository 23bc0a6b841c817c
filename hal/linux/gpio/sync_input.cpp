#include "hal/linux/gpio/sync_input.h"

#include <algorithm>

namespace nodal::hal::gpio {

void SyncInput::start(FrameRate rate, Instant from) {
  rate_ = rate;
  from_ = from;
  known_ = false;
  number_ = 0;
  regular_ = 0;
}

std::optional<TriggerEdge> SyncInput::add(Instant at, bool after_overrun) {
  if (at < from_) return std::nullopt;
  if (!known_) {
    known_ = true;
    newest_ = at;
    return TriggerEdge{0, at};
  }
  const Duration period = rate_.period();
  const Duration since = at - newest_;
  // The number of periods, rounded; 2^63 ns / 1 ms of them fit.
  const std::int64_t steps = since.ns() <= 0 ? 0 : (since.ns() + period.ns() / 2) / period.ns();
  const Instant predicted = newest_ + rate_.start_of(static_cast<std::uint64_t>(steps));
  const Duration off = at - predicted;
  if (steps >= 1 && std::max(off, -off) <= period / kWindow) {
    (after_overrun ? counts_.overrun : counts_.lost) += static_cast<std::uint64_t>(steps) - 1;
    return accept(at, static_cast<std::uint64_t>(steps), predicted);
  }
  if (jumped(at)) {
    ++counts_.jumps;
    const auto numbers = static_cast<std::uint64_t>(std::max<std::int64_t>(steps, 1));
    return accept(at, numbers, at);
  }
  ++counts_.doubled;
  return std::nullopt;
}

TriggerEdge SyncInput::accept(Instant at, std::uint64_t steps, Instant predicted) {
  number_ += steps;
  newest_ = predicted + (at - predicted) / kFilter;
  regular_ = 0;
  return {number_, at};
}

bool SyncInput::jumped(Instant at) {
  const Duration period = rate_.period();
  const Duration off = at - discarded_ - period;
  regular_ = regular_ > 0 && std::max(off, -off) <= period / kWindow ? regular_ + 1 : 1;
  discarded_ = at;
  return regular_ >= kJump;
}

}  // namespace nodal::hal::gpio
