#include "tests/sim/trigger.h"

namespace nodal::swarm {
namespace {

/// Edges that were not taken: as many periods as the kernel queues for a GPIO line.
constexpr std::size_t kEdgesKept = 64;

}  // namespace

Trigger::Trigger(hal::sim::SimClock& clock, EventQueue& queue, const TriggerNature& nature, std::uint64_t seed,
                 Sink sink)
    : clock_(clock), queue_(queue), nature_(nature), random_(seed, "trigger"), sink_(std::move(sink)) {}

Status Trigger::start(const hal::TriggerSettings& settings) {
  if (gone_) return fail(Errc::kDeviceGone, "trigger: unplugged; restart nodald when it is back");
  if (settings.pulse_width >= settings.rate.period()) {
    return fail(Errc::kBadValue, "trigger: the pulse is longer than its period");
  }
  settings_ = settings;
  running_ = true;
  ++epoch_;
  base_ = next_ = 0;
  base_at_ = clock_.now() + nature_.first_pulse;
  newest_seen_ = clock_.now();
  edges_.clear();
  queue_.plan(base_at_, EventKind::kPulse, 0, epoch_);
  return {};
}

void Trigger::stop() {
  running_ = false;
  edges_.clear();
}

Result<std::optional<hal::TriggerEdge>> Trigger::take_edge() {
  if (gone_) return fail(Errc::kDeviceGone, "trigger: unplugged; restart nodald when it is back");
  if (edges_.empty()) return std::optional<hal::TriggerEdge>{};
  const hal::TriggerEdge edge = edges_.front();
  edges_.pop_front();
  return std::optional<hal::TriggerEdge>{edge};
}

Instant Trigger::planned(std::uint64_t number) const {
  const Duration ideal = settings_.rate.start_of(number - base_);
  return base_at_ + ideal + Duration::nanoseconds(ideal.us() * nature_.drift_ppb / 1'000'000);
}

void Trigger::set_drift(std::int64_t ppb) {
  if (running_) {
    base_at_ = planned(next_);
    base_ = next_;
  }
  nature_.drift_ppb = ppb;
}

void Trigger::on_event(const Event& event) {
  if (!running_ || gone_ || event.epoch != epoch_) return;
  const std::uint64_t number = next_++;
  queue_.plan(std::max(planned(next_) + random_.around_zero(nature_.jitter), event.at), EventKind::kPulse, 0, epoch_);
  if (lose_ > 0) {
    --lose_;
    return;
  }
  if (hide_ > 0) {
    --hide_;
  } else {
    if (edges_.size() == kEdgesKept) edges_.pop_front();
    edges_.push_back({number, event.at});
    newest_seen_ = event.at;
  }
  sink_({epoch_, number}, event.at);
}

void Trigger::send_extra() {
  if (running()) sink_({}, clock_.now());
}

}  // namespace nodal::swarm
