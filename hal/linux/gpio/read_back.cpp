#include "hal/linux/gpio/read_back.h"

#include <algorithm>

namespace nodal::hal::gpio {

void ReadBack::start(Duration period) {
  constexpr Duration kFarthest = Duration::milliseconds(20);
  reach_ = std::min(period / 2, kFarthest);
  pulses_.size = 0;
  edges_.size = 0;
}

void ReadBack::add_pulse(const TriggerEdge& pulse) {
  if (!pulses_.push(pulse)) ++unseen_;
}

void ReadBack::add_edge(Instant at) {
  if (!edges_.push(at)) ++extra_;
}

std::optional<TriggerEdge> ReadBack::take(Instant now) {
  for (;;) {
    if (pulses_.size == 0) {
      // The pulse of a new edge may not be logged yet: the kernel can see the edge before the write returns.
      while (edges_.size > 0 && now - edges_.front() > reach_) {
        edges_.pop();
        ++extra_;
      }
      return std::nullopt;
    }
    const TriggerEdge pulse = pulses_.front();
    if (edges_.size > 0 && edges_.front() < pulse.at - reach_) {
      edges_.pop();
      ++extra_;
    } else if (edges_.size > 0 && edges_.front() <= pulse.at + reach_) {
      const Instant at = edges_.front();
      edges_.pop();
      pulses_.pop();
      return TriggerEdge{pulse.number, at};
    } else if (edges_.size > 0 || now > pulse.at + reach_) {
      pulses_.pop();
      ++unseen_;
    } else {
      return std::nullopt;
    }
  }
}

}  // namespace nodal::hal::gpio
