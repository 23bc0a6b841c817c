#include "firmware/sync/set_clock.h"

#include <algorithm>
#include <cstdlib>

namespace nodal::firmware {
namespace {

/// The grid moves by an eighth of each set's distance: it settles within a second, and the jitter of one set hardly
/// moves it.
constexpr std::int64_t kFollow = 8;

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

void SetClock::restart(FrameRate rate, bool genlocked, Instant now) {
  period_ = rate.period();
  genlocked_ = genlocked;
  since_ = now;
  base_ = highest_ + 1;
  edge_count_ = 0;
  last_ = {};
  anchored_ = false;
}

void SetClock::on_edge(const hal::TriggerEdge& edge) {
  edges_[edge_count_ % kEdges] = edge;
  ++edge_count_;
}

std::optional<SetClock::Match> SetClock::match(std::size_t head, Instant mid_exposure, Exposure exposure,
                                               Duration trigger_delay) {
  const Instant begin = mid_exposure - exposure.duration() / 2 - trigger_delay;
  if (!genlocked_) {
    if (begin < since_)
      return std::nullopt;  // from a wired head, which keeps streaming: there may already be a set of its pulse
    return match_grid(head, mid_exposure);
  }
  if (begin < since_ + kStampsOff) return std::nullopt;
  const hal::TriggerEdge* nearest = nullptr;
  bool too_old = edge_count_ > 0;
  for (std::size_t i = 0; i < std::min<std::uint64_t>(edge_count_, kEdges); ++i) {
    if (!nearest || abs(begin - edges_[i].at) < abs(begin - nearest->at)) nearest = &edges_[i];
    too_old &= begin < edges_[i].at;
  }
  if (nearest && abs(begin - nearest->at) <= period_ / 2) {
    const Slot slot = base_ + static_cast<Slot>(nearest->number);
    use(head, slot, mid_exposure);
    return Match{slot, nearest->number, begin - nearest->at};
  }
  if (too_old) return std::nullopt;
  return match_grid(head, mid_exposure);
}

SetClock::Match SetClock::match_grid(std::size_t head, Instant mid_exposure) {
  if (!anchored_) use(head, base_, mid_exposure);
  const std::int64_t period = period_.ns();
  Slot slot = anchor_slot_ + floor_div((mid_exposure - anchor_time_ + period_ / 2).ns(), period);
  if (const auto& last = last_[head]) {
    const Slot next = last->slot + floor_div((mid_exposure - last->mid_exposure + period_ / 2).ns(), period);
    if (next <= last->slot) {
      slot = last->slot;  // the same exposure again; the grid may have moved since
    } else if (abs(mid_exposure - middle_of(next)) <= period_ * kReachTenths / 10) {
      slot = next;
    }
  }
  const Match match{slot, std::nullopt, mid_exposure - middle_of(slot)};
  use(head, slot, mid_exposure);
  return match;
}

void SetClock::use(std::size_t head, Slot slot, Instant mid_exposure) {
  highest_ = std::max(highest_, slot);
  last_[head] = Step{slot, mid_exposure};
  if (anchored_) return;
  anchored_ = true;
  anchor_slot_ = slot;
  anchor_time_ = mid_exposure;
}

void SetClock::follow(Slot slot, Instant mid_exposure) {
  if (!anchored_) return;
  const Instant middle = middle_of(slot);
  const Duration off = mid_exposure - middle;
  // The anchor moves with the slots, so that a head's drift does not accumulate over many periods.
  anchor_slot_ = slot;
  anchor_time_ = abs(off) > period_ ? mid_exposure : middle + off / kFollow;
}

}  // namespace nodal::firmware
