#include "firmware/set_clock.h"

#include <algorithm>
#include <cstdlib>

namespace nodal::firmware {
namespace {

/// The grid takes a sixteenth of each frame's distance: it settles in a second of a few heads, and one frame's
/// jitter hardly moves it.
constexpr std::int64_t kFollow = 16;

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

Duration distance(Duration d) { return d < Duration() ? -d : d; }

}  // namespace

void SetClock::restart(FrameRate rate, bool genlocked) {
  period_ = rate.period();
  genlocked_ = genlocked;
  base_ = highest_ + 1;
  edge_count_ = 0;
  anchored_ = false;
}

void SetClock::on_edge(const hal::TriggerEdge& edge) {
  edges_[edge_count_ % kEdges] = edge;
  ++edge_count_;
}

bool SetClock::pulses_missing(Instant now) const {
  if (edge_count_ == 0) return true;
  return now - edges_[(edge_count_ - 1) % kEdges].at > period_ * 5 / 2;
}

std::optional<SetClock::Match> SetClock::match(Instant mid_exposure, Exposure exposure, Duration trigger_delay,
                                               Instant now) {
  if (!genlocked_) return match_grid(mid_exposure);
  const Instant begin = mid_exposure - exposure.duration() / 2 - trigger_delay;
  const hal::TriggerEdge* nearest = nullptr;
  for (std::size_t i = 0; i < std::min<std::uint64_t>(edge_count_, kEdges); ++i) {
    if (!nearest || distance(begin - edges_[i].at) < distance(begin - nearest->at)) nearest = &edges_[i];
  }
  if (nearest && distance(begin - nearest->at) <= period_ / 2) {
    const Slot slot = base_ + static_cast<Slot>(nearest->number);
    follow(slot, mid_exposure);
    return Match{slot, nearest->number, begin - nearest->at};
  }
  if (!pulses_missing(now)) return std::nullopt;
  return match_grid(mid_exposure);
}

SetClock::Match SetClock::match_grid(Instant mid_exposure) {
  if (!anchored_) follow(base_, mid_exposure);
  const std::int64_t from_anchor = (mid_exposure - anchor_time_ + period_ / 2).ns();
  const Slot slot = anchor_slot_ + floor_div(from_anchor, period_.ns());
  const Match match{slot, std::nullopt, mid_exposure - middle_of(slot)};
  follow(slot, mid_exposure);
  return match;
}

void SetClock::follow(Slot slot, Instant mid_exposure) {
  highest_ = std::max(highest_, slot);
  if (!anchored_) {
    anchored_ = true;
    anchor_slot_ = slot;
    anchor_time_ = mid_exposure;
    return;
  }
  const Duration off = mid_exposure - middle_of(slot);
  // The anchor moves on with the slots, so that a head's drift never adds up over many periods.
  if (slot > anchor_slot_) {
    anchor_time_ = middle_of(slot);
    anchor_slot_ = slot;
  }
  anchor_time_ = anchor_time_ + off / kFollow;
}

}  // namespace nodal::firmware
