#include "hal/sim/pin.h"

#include "protocol/base/try.h"

namespace nodal::hal::sim {

Status SimOutputPin::set(bool high, Instant now, Duration lease) {
  NODAL_TRY(step(now));
  if (lease.ns() <= 0) return fail(Errc::kBadValue, "output pin 'sim': a lease must be longer than 0 ns");
  until_ = now + lease;
  drive(high, now);
  return {};
}

Status SimOutputPin::step(Instant now) {
  if (made_safe_.load()) return fail(Errc::kDeviceGone, "output pin 'sim': is safe for good; the program ends");
  if (gone_) return fail(Errc::kDeviceGone, "output pin 'sim': its chip is unplugged");
  if (now >= until_) drive(safe_, until_);
  return {};
}

void SimOutputPin::drive(bool high, Instant at) {
  if (high == high_) return;
  high_ = high;
  if (std::ssize(history_) == kKept) history_.erase(history_.begin(), history_.begin() + kKept / 2);
  history_.push_back({at, high});
}

Result<bool> SimInputPin::level() {
  if (gone_) return fail(Errc::kDeviceGone, "input pin 'sim': its chip is unplugged");
  play();
  return high_;
}

Result<std::optional<PinEdge>> SimInputPin::take_edge() {
  if (gone_) return fail(Errc::kDeviceGone, "input pin 'sim': its chip is unplugged");
  play();
  if (edges_.empty()) return std::optional<PinEdge>{};
  const PinEdge edge = edges_.front();
  edges_.pop_front();
  return std::optional<PinEdge>{edge};
}

void SimInputPin::play() {
  const Instant now = clock_.now();
  while (!script_.empty() && script_.front().at <= now) {
    if (script_.front().high != high_) {
      high_ = script_.front().high;
      edges_.push_back(script_.front());
    }
    script_.pop_front();
  }
}

}  // namespace nodal::hal::sim
