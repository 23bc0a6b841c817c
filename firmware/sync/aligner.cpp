#include "firmware/sync/aligner.h"

#include <algorithm>
#include <span>

#include "firmware/frame/statistics.h"

namespace nodal::firmware {
namespace {

constexpr std::int64_t kAhead = 4;  ///< periods until a nudge requested now has been carried out, about
/// A head that has not moved so long after its stated latency counts as unresponsive. A set is closed up to 2.5 periods
/// after its middle: once before the nudge is requested, and once before its effect is seen; and the request may miss
/// the start of one period.
constexpr int kPeriodsOfGrace = 6;

/// Moves a difference into the range of half a period to either side.
Duration wrapped(Duration d, Duration period) {
  const std::int64_t rest = ((d + period / 2).ns() % period.ns() + period.ns()) % period.ns();
  return Duration::nanoseconds(rest) - period / 2;
}

Duration in_steps(Duration by, Duration step) {
  const std::int64_t steps = (abs(by) + step / 2).ns() / step.ns();
  return step * (by < Duration() ? -steps : steps);
}

/// From the begin of an exposure by the head's clock to its middle: nudges plus half the exposure.
Duration place_of(const hal::FrameView& frame) { return frame.nudged + frame.in_effect.exposure.duration() / 2; }

}  // namespace

void Aligner::restart(Duration period) {
  period_ = period;
  heads_ = {};
  for (Head& head : heads_) head.clock.restart(period);
  reference_.reset();
  beat_.reset();
  fixed_ = one_way_ = unresponsive_ = 0;
}

void Aligner::on_frame(std::size_t index, std::uint64_t starts, const hal::FrameView& frame) {
  Head& head = heads_[index];
  if (head.starts != starts) {
    head.starts = starts;
    head.clock.restart_phase();
    // Requests from before this start count as done, because they can no longer take effect.
    head.requested = head.done = frame.nudged;
    head.place_in_set = place_of(frame);
  }
  head.clock.add(frame.mid_exposure - place_of(frame));
  if (frame.nudged != head.done) head.responds = true;
  follow(head, frame);
  head.done = frame.nudged;
}

/// A head that does not move for long gets a new request. A head that moves away from the requested phase still carries
/// out an older request; it gets none until it stops moving, because another request would make it oscillate. Times are
/// those of exposures, because frames may arrive late, and many at once.
void Aligner::follow(Head& head, const hal::FrameView& frame) const {
  const Duration open = head.requested - frame.nudged;
  const Duration latency = period_ * head.limits.latency_frames;
  if (frame.nudged != head.done) {
    head.still_since = frame.mid_exposure;
    if (abs(open) <= abs(head.requested - head.done)) return;
    head.requested = frame.nudged;
    head.left_alone_until = frame.mid_exposure + latency + period_ * 2;
  } else if (open != Duration() && frame.mid_exposure - head.still_since > latency + period_ * kPeriodsOfGrace) {
    head.responds = false;
    head.requested = frame.nudged;
  }
}

Duration Aligner::band(bool in_step) const {
  Duration jitter;
  for (const Head& head : heads_) jitter = std::max(jitter, head.starts > 0 ? head.clock.jitter() : Duration());
  // The largest uniform error is twice the mean absolute error.
  const Duration left = Genlock::kSafeLimit - jitter * 4;
  const Duration band = std::max(left / kBandsInLimit, kBandMin);
  return in_step ? band : std::max(band / 2, kBandMin);
}

/// Where every head will be, and where the reference is, after `base`.
std::optional<Duration> Aligner::reference_place(const std::array<FreeHead, kMaxHeads>& heads, Instant base, Instant at,
                                                 Instant now, Nudges& places, HeadMask& placed) const {
  std::array<Duration, kMaxHeads> all{}, fixed{};
  std::size_t known = 0, known_fixed = 0;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    // What is known of a head that was restarted since is from before the restart.
    if (heads[i].starts != heads_[i].starts || !heads[i].streaming || !heads_[i].clock.known(now)) continue;
    const Instant middle = heads_[i].clock.nearest(at) + heads_[i].requested + heads[i].exposure.duration() / 2;
    places[i] = wrapped(middle - base, period_);
    placed |= head_bit(i);
    all[known++] = places[i];
    if (!heads[i].limits.possible()) fixed[known_fixed++] = places[i];
  }
  if (known == 0) return std::nullopt;
  if (known_fixed > 0) return median(std::span(fixed).first(known_fixed));
  const Duration middle = median(std::span(all).first(known));
  Duration latest;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if ((placed & head_bit(i)) == 0 || heads[i].limits.shortest != Duration()) continue;
    const Duration after = wrapped(places[i] - middle, period_);
    if (after <= near()) latest = std::max(latest, after);
  }
  return middle + latest;
}

Aligner::Nudges Aligner::plan(const std::array<FreeHead, kMaxHeads>& heads, bool in_step, Instant now) {
  Nudges nudges{}, places{};
  HeadMask placed = 0;
  const Instant at = now + period_ * kAhead;
  fixed_ = one_way_ = unresponsive_ = 0;
  // Phases are relative to the last reference, so that a head slightly before it does not count as one period after it.
  const Instant base = reference_ ? at + wrapped(*reference_ - at, period_) : at;
  const auto reference = reference_place(heads, base, at, now, places, placed);
  if (!reference) return nudges;
  reference_ = base + *reference;
  const Duration band = this->band(in_step);
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    heads_[i].limits = heads[i].limits;
    if ((placed & head_bit(i)) == 0) continue;
    const hal::NudgeLimits& limits = heads[i].limits;
    if (!limits.possible()) {
      fixed_ |= head_bit(i);
      continue;
    }
    Duration off = wrapped(*reference - places[i], period_);
    if (limits.shortest == Duration() && off < -near()) off = off + period_;  // it waits for the next period
    // Requests of less than five eighths of a step would not reduce the distance.
    const bool present = abs(off) <= std::max(band, limits.step * 5 / 8);
    if (present && heads_[i].requested == heads_[i].done) heads_[i].responds = true;  // until it misses a request
    if (!heads_[i].responds) unresponsive_ |= head_bit(i);
    // One request at a time; with several, it would be unknown which one a movement carries out.
    if (present || heads_[i].requested != heads_[i].done || now < heads_[i].left_alone_until) continue;
    if ((off < Duration() ? limits.shortest : limits.longest) == Duration()) {
      one_way_ |= head_bit(i);
      continue;
    }
    nudges[i] = in_steps(off, limits.step);
    heads_[i].still_since = now;
    heads_[i].requested = heads_[i].requested + nudges[i];
  }
  return nudges;
}

/// The median of the heads' periods.
Duration Aligner::true_period() const {
  std::array<std::int32_t, kMaxHeads> drifts{};
  std::size_t known = 0;
  for (const Head& head : heads_) {
    if (const auto drift = head.clock.drift_ppb()) drifts[known++] = *drift;
  }
  if (known == 0) return period_;
  return period_ + Duration::nanoseconds(period_.ns() / 1000 * median(std::span(drifts).first(known)) / 1'000'000);
}

/// The reference jumps when an exposure changes. Skews need an origin that does not jump, so they are measured from a
/// separate sequence of times at the heads' rate.
Skews Aligner::skews(const FrameSet& set) {
  if (!beat_) beat_ = newest_set_ = set.mid_exposure;
  const Duration half = period_ / 2;
  const Duration since = set.mid_exposure - newest_set_;
  *beat_ = *beat_ + true_period() * ((since + (since < Duration() ? -half : half)).ns() / period_.ns());
  newest_set_ = set.mid_exposure;
  Skews skews;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!set.has(i)) continue;
    const Duration place = place_of(set.frames[i]);
    skews.add(i, set.frames[i].mid_exposure - *beat_, place - heads_[i].place_in_set);
    heads_[i].place_in_set = place;
  }
  return skews;
}

}  // namespace nodal::firmware
