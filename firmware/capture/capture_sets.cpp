// The part of Capture that groups frames into sets.
#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "firmware/capture/capture.h"
#include "firmware/capture/capture_log.h"
#include "firmware/frame/statistics.h"

namespace nodal::firmware {
namespace {

Duration spread_of(const Skews& skews) {
  std::optional<Duration> earliest, latest;
  for (std::size_t i = 0; i < skews.of.size(); ++i) {
    if ((skews.known & head_bit(i)) == 0) continue;
    earliest = std::min(earliest.value_or(skews.of[i]), skews.of[i]);
    latest = std::max(latest.value_or(skews.of[i]), skews.of[i]);
  }
  return earliest ? *latest - *earliest : Duration();
}

}  // namespace

/// Takes one frame of every head per round. After a stall, taking all frames of one head first would fill and close all
/// open sets with that head's frames, and the other heads' frames would be late.
bool Capture::take_frames() {
  constexpr int kRounds = 8;  // bounds the duration of a step when a head delivers frames too fast
  bool any = false;
  for (int round = 0; round < kRounds; ++round) {
    bool more = false;
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      const std::uint64_t before = heads_[i].report().counts.frames;
      const auto frame = heads_[i].take_frame();
      more |= heads_[i].report().counts.frames != before;
      if (frame) place(i, *frame);
    }
    if (!more) break;
    any = true;
    close_complete_sets();
  }
  return any;
}

/// A frame's exposure ends before its last byte arrives, and not long before. Otherwise the head's clock has wrapped or
/// was set; accepting one such frame would close sets of the future and make every later frame too late.
bool Capture::plausible(const hal::FrameView& frame) const {
  const Duration age = frame.received - frame.mid_exposure;
  return age >= Duration() && age <= kOldest + clock_.period() * kMaxOpenSets;
}

std::optional<SetClock::Match> Capture::match(std::size_t head, const hal::FrameView& frame) {
  const Duration delay = wiring_[head].delay;
  const auto match = clock_.match(head, frame.mid_exposure, frame.in_effect.exposure, delay);
  if (match && match->trigger) return match;
  // The thread may have been suspended after it read the pulses of this step, so this frame's pulse may be unread.
  if (!take_edges()) return match;
  return clock_.match(head, frame.mid_exposure, frame.in_effect.exposure, delay);
}

void Capture::place(std::size_t head, const hal::FrameView& frame) {
  if (!plausible(frame)) return heads_[head].lose(frame, LossReason::kBadTime);
  const auto match = this->match(head, frame);
  if (!match) return heads_[head].lose(frame, LossReason::kUnmatched);
  if (newest_closed_ && match->slot <= *newest_closed_) return heads_[head].lose(frame, LossReason::kLate);
  OpenSet* open = open_set(match->slot);
  if (!open) return heads_[head].lose(frame, LossReason::kOverload);
  if (open->set->has(head)) return heads_[head].lose(frame, LossReason::kDuplicate);
  FrameSet& set = open->set.edit();
  set.frames[head] = frame;
  set.mask |= head_bit(head);
  if (match->trigger) {
    open->skews.add(head, match->skew);
    set.sync.trigger = match->trigger;
    if (wiring_[head].wired) pulse_watch_[head].add(*match->trigger, match->skew, frame.sequence);
  }
  heads_[head].hold(frame);
  if (pulsed()) return;
  head_drift_[head].add(match->slot, frame.mid_exposure);
  aligner_.on_frame(head, heads_[head].starts(), frame);
}

Capture::OpenSet* Capture::open_set(SetClock::Slot slot) {
  const auto at = std::lower_bound(open_.begin(), open_.end(), slot,
                                   [](const OpenSet& open, SetClock::Slot s) { return open.slot < s; });
  if (at != open_.end() && at->slot == slot) return &*at;
  const auto index = at - open_.begin();
  if (open_.size() == kMaxOpenSets) {
    if (index == 0) return nullptr;  // older than every open set
    close_oldest();
    return open_set(slot);
  }
  SetLoan set = take_set();
  if (!set) return nullptr;
  set.edit().sync = {};
  return &*open_.insert(open_.begin() + index, OpenSet{slot, std::move(set), {}});
}

bool Capture::complete(const OpenSet& open) const {
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!open.set->has(i) && heads_[i].expected()) return false;
  }
  return true;
}

bool Capture::close_complete_sets() {
  bool any = false;
  while (!open_.empty() && complete(open_.front())) {
    close_oldest();
    any = true;
  }
  return any;
}

Instant Capture::due(const OpenSet& open) const {
  return clock_.middle_of(open.slot) + clock_.period() * kHalfPeriodsToWait / 2;
}

bool Capture::close_due_sets(Instant now) {
  bool any = close_complete_sets();
  while (!open_.empty()) {
    if (now < due(open_.front())) break;
    close_oldest();
    close_complete_sets();
    any = true;
  }
  return any;
}

void Capture::close_all(Instant now) {
  now_ = now;
  while (!open_.empty()) close_oldest();
}

void Capture::close_oldest() {
  OpenSet open = std::move(open_.front());
  open_.erase(open_.begin());
  newest_closed_ = open.slot;
  FrameSet& set = open.set.edit();
  describe(open);
  clock_.follow(open.slot, set.mid_exposure);
  set.number = report_.sets++;
  set.period = clock_.period();
  bool every_present = true;
  bool every_head = true;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (set.has(i)) {
      heads_[i].put_in_set(set.sync.offset[i]);
      continue;
    }
    every_head = false;
    if (heads_[i].streaming()) every_present = false;
    heads_[i].missed_set(clock_.period());
  }
  if (every_head) ++report_.full_sets;
  if (genlock_.aligning()) {
    genlock_.on_set(set, aligner_.skews(set), every_present, now_, aligner_.unresponsive());
    align_now_ = true;
  } else {
    genlock_.on_set(set, open.skews, every_present, now_);
  }
  set.sync.state = genlock_.state();
  if (log_) log_->note(SetClosed{set.number, set.mid_exposure, set.mask, set.sync});
  outlets_.offer(open.set);
  open.set = {};
  collect_sets();  // returns the frames at once if no outlet took the set
}

/// Aligns free-running heads, after every set and after every requested exposure. Nudge and exposure are requested in
/// the same step, so that both take effect in the same frame.
void Capture::align() {
  if (!std::exchange(align_now_, false) || !genlock_.aligning()) return;
  std::array<FreeHead, kMaxHeads> free;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!heads_[i].streaming()) continue;
    free[i] = {true, heads_[i].starts(), heads_[i].report().limits->nudge, heads_[i].pending_exposure()};
  }
  const bool in_step = genlock_.state() == GenlockState::kLocked || genlock_.state() == GenlockState::kHoldover;
  const Aligner::Nudges nudges = aligner_.plan(free, in_step, now_);
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (nudges[i] != Duration()) heads_[i].nudge(nudges[i]);
  }
}

/// The drift of the pulses if there are pulses; otherwise the median of the heads' drifts.
std::optional<std::int32_t> Capture::drift_ppb() const {
  if (pulsed()) return pulse_drift_.ppb();
  std::array<std::int32_t, kMaxHeads> drifts{};
  std::size_t known = 0;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (const auto drift = head_drift_[i].ppb()) drifts[known++] = *drift;
  }
  if (known == 0) return std::nullopt;
  return median(std::span(drifts).first(known));
}

void Capture::describe(const OpenSet& open) {
  FrameSet& set = open.set.edit();
  std::array<Instant, kMaxHeads> middles;
  std::size_t count = 0;
  for (std::size_t i = 0; i < middles.size(); ++i) {
    if (set.has(i)) middles[count++] = set.frames[i].mid_exposure;
  }
  NODAL_ASSERT(count > 0);
  std::sort(middles.begin(), middles.begin() + static_cast<std::ptrdiff_t>(count));
  set.mid_exposure = middles[count / 2];
  set.second_field = rate_.period() / 2;  // rate_, not rate_now_: the head's own rate separates its two fields
  set.sync.spread = middles[count - 1] - middles[0];
  for (std::size_t i = 0; i < middles.size(); ++i) {
    set.sync.offset[i] = set.has(i) ? set.frames[i].mid_exposure - set.mid_exposure : Duration();
  }
  if (open.skews.known == set.mask) set.sync.begin_spread = spread_of(open.skews);
  set.sync.drift_ppb = drift_ppb();
  set_rate_.add(set.mid_exposure, set.sync.drift_ppb);
  set.rate = set_rate_.rate();
}

}  // namespace nodal::firmware
