// The half of Capture that makes sets of frames.
#include <algorithm>
#include <array>

#include "firmware/capture.h"

namespace nodal::firmware {
/// One frame of every head, then the next: after a stall, heads that are taken one by one would fill all open sets
/// with the first head's frames and find the others late.
bool Capture::take_frames(Instant now) {
  constexpr int kRounds = 8;  // so that a head that floods cannot keep the step from ending
  bool any = false;
  for (int round = 0; round < kRounds; ++round) {
    bool more = false;
    for (std::size_t i = 0; i < heads_.size(); ++i) {
      const std::uint64_t before = heads_[i].report().counts.frames;
      const auto frame = heads_[i].take_frame();
      more |= heads_[i].report().counts.frames != before;
      if (frame) place(i, *frame, now);
    }
    if (!more) break;
    any = true;
    close_complete_sets();
  }
  return any;
}

std::optional<SetClock::Match> Capture::match(std::size_t head, const hal::FrameView& frame, Instant now) {
  const Duration delay = genlock_.settings().delay[head];
  auto match = clock_.match(frame.mid_exposure, frame.in_effect.exposure, delay, now);
  // Its pulse may have been sent since the pulses were looked at, when this thread had to wait in between.
  if (!match && take_edges()) match = clock_.match(frame.mid_exposure, frame.in_effect.exposure, delay, now);
  return match;
}

void Capture::place(std::size_t head, const hal::FrameView& frame, Instant now) {
  const auto match = this->match(head, frame, now);
  if (!match) return heads_[head].lose(frame, LossReason::kUnmatched);
  SetClock::Slot slot = match->slot;
  OpenSet* open = nullptr;
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (newest_closed_ && slot <= *newest_closed_) return heads_[head].lose(frame, LossReason::kLate);
    open = open_set(slot);
    if (!open) return heads_[head].lose(frame, LossReason::kOverload);
    if (!open->set->has(head)) break;
    // In free run the grid moves under a head near its border: its next frame is then the next slot's.
    const Duration apart = frame.mid_exposure - open->set->frames[head].mid_exposure;
    if (attempt > 0 || match->trigger || apart <= clock_.period() / 2) {
      return heads_[head].lose(frame, LossReason::kDuplicate);
    }
    ++slot;
  }
  FrameSet& set = *open->set;
  set.frames[head] = frame;
  set.mask |= head_bit(head);
  if (match->trigger) {
    const bool first = !set.sync.trigger;
    open->skews.earliest = first ? match->skew : std::min(open->skews.earliest, match->skew);
    open->skews.latest = first ? match->skew : std::max(open->skews.latest, match->skew);
    set.sync.trigger = match->trigger;
  } else {
    open->all_triggered = false;
  }
  heads_[head].hold(frame);
  if (!genlock_.running()) head_drift_[head].add(slot, frame.mid_exposure);
}

Capture::OpenSet* Capture::open_set(SetClock::Slot slot) {
  const auto at = std::lower_bound(open_.begin(), open_.end(), slot,
                                   [](const OpenSet& open, SetClock::Slot s) { return open.slot < s; });
  if (at != open_.end() && at->slot == slot) return &*at;
  if (free_.empty()) return nullptr;
  const auto index = at - open_.begin();
  if (open_.size() == kMaxOpenSets) {
    if (index == 0) return nullptr;  // older than everything that waits
    close_oldest();
    return open_set(slot);
  }
  FrameSet* set = free_.back();
  free_.pop_back();
  set->mask = 0;
  set->sync = {};
  return &*open_.insert(open_.begin() + index, OpenSet{slot, set, true, {}});
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

bool Capture::close_due_sets(Instant now) {
  bool any = close_complete_sets();
  while (!open_.empty()) {
    const Instant deadline = clock_.middle_of(open_.front().slot) + clock_.period() * kHalfPeriodsToWait / 2;
    if (now < deadline) break;
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
  const OpenSet open = open_.front();
  open_.erase(open_.begin());
  newest_closed_ = open.slot;
  FrameSet& set = *open.set;
  describe(open);
  set.number = report_.sets++;
  bool every_present = true;
  bool every_head = true;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (set.has(i)) {
      heads_[i].put_in_set(set.sync.offset[i]);
      continue;
    }
    every_head = false;
    if (heads_[i].streaming()) every_present = false;
    heads_[i].missed_set();
  }
  if (every_head) ++report_.full_sets;
  const auto skews = open.all_triggered ? std::optional(open.skews) : std::nullopt;
  genlock_.on_set(set, skews, every_present, now_);
  set.sync.state = genlock_.state();
  FrameSet* lent = &set;
  if (sets_out_.push(std::move(lent))) return;
  ++report_.sets_not_taken;
  give_back(&set);
}

/// The pulses' drift when there are pulses; else that of the heads, of which the middle one is told.
std::optional<std::int32_t> Capture::drift_ppb() const {
  if (genlock_.running()) return pulse_drift_.ppb();
  std::array<std::int32_t, kMaxHeads> drifts{};
  std::size_t known = 0;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (const auto drift = head_drift_[i].ppb()) drifts[known++] = *drift;
  }
  if (known == 0) return std::nullopt;
  const auto middle = drifts.begin() + static_cast<std::ptrdiff_t>(known / 2);
  std::nth_element(drifts.begin(), middle, drifts.begin() + static_cast<std::ptrdiff_t>(known));
  return *middle;
}

void Capture::describe(const OpenSet& open) {
  FrameSet& set = *open.set;
  std::array<Instant, kMaxHeads> middles;
  std::size_t count = 0;
  for (std::size_t i = 0; i < middles.size(); ++i) {
    if (set.has(i)) middles[count++] = set.frames[i].mid_exposure;
  }
  NODAL_ASSERT(count > 0);
  std::sort(middles.begin(), middles.begin() + static_cast<std::ptrdiff_t>(count));
  set.mid_exposure = middles[count / 2];
  set.sync.spread = middles[count - 1] - middles[0];
  for (std::size_t i = 0; i < middles.size(); ++i) {
    set.sync.offset[i] = set.has(i) ? set.frames[i].mid_exposure - set.mid_exposure : Duration();
  }
  if (open.all_triggered) set.sync.begin_spread = open.skews.latest - open.skews.earliest;
  set.sync.drift_ppb = drift_ppb();
}

}  // namespace nodal::firmware
