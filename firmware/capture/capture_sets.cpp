// The part of Capture that groups frames into sets.
#include <array>
#include <utility>

#include "firmware/capture/capture.h"
#include "firmware/capture/capture_log.h"

namespace nodal::firmware {
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
  return age >= Duration() && age <= kOldest + timing_.period() * kMaxOpenSets;
}

std::optional<SetClock::Match> Capture::match(std::size_t head, const hal::FrameView& frame) {
  const auto match = timing_.match(head, frame);
  if (match && match->trigger) return match;
  // The thread may have been suspended after it read the pulses of this step, so this frame's pulse may be unread.
  if (!take_edges()) return match;
  return timing_.match(head, frame);
}

void Capture::place(std::size_t head, const hal::FrameView& frame) {
  if (!plausible(frame)) return heads_[head].lose(frame, LossReason::kBadTime);
  const auto match = this->match(head, frame);
  if (!match) return heads_[head].lose(frame, LossReason::kUnmatched);
  const auto newest_closed = assembly_.newest_closed();
  if (newest_closed && match->slot <= *newest_closed) return heads_[head].lose(frame, LossReason::kLate);
  SetAssembly::OpenSet* open = assembly_.find(match->slot);
  if (!open && assembly_.must_close_for(match->slot)) close_oldest();
  if (!open) open = assembly_.open(match->slot);
  if (!open) return heads_[head].lose(frame, LossReason::kOverload);
  if (open->set->has(head)) return heads_[head].lose(frame, LossReason::kDuplicate);
  FrameSet& set = open->set.edit();
  set.frames[head] = frame;
  set.mask |= head_bit(head);
  if (match->trigger) {
    open->skews.add(head, match->skew);
    set.sync.trigger = match->trigger;
    timing_.add_pulsed(head, *match, frame);
  }
  heads_[head].hold(frame);
  if (pulsed()) return;
  timing_.add_free(head, *match, frame);
  aligner_.on_frame(head, heads_[head].starts(), frame);
}

bool Capture::complete(const FrameSet& set) const {
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!set.has(i) && heads_[i].expected()) return false;
  }
  return true;
}

bool Capture::close_complete_sets() {
  bool any = false;
  while (!assembly_.empty() && complete(*assembly_.oldest().set)) {
    close_oldest();
    any = true;
  }
  return any;
}

Instant Capture::due(const SetAssembly::OpenSet& open) const {
  return timing_.middle_of(open.slot) + timing_.period() * kHalfPeriodsToWait / 2;
}

bool Capture::close_due_sets(Instant now) {
  bool any = close_complete_sets();
  while (!assembly_.empty()) {
    if (now < due(assembly_.oldest())) break;
    close_oldest();
    close_complete_sets();
    any = true;
  }
  return any;
}

void Capture::close_all(Instant now) {
  now_ = now;
  while (!assembly_.empty()) close_oldest();
}

void Capture::close_oldest() {
  SetAssembly::OpenSet open = assembly_.close_oldest();
  FrameSet& set = open.set.edit();
  timing_.describe(set, open.skews, pulsed());
  timing_.follow(open.slot, set);
  set.number = report_.sets++;
  set.period = timing_.period();
  bool every_present = true;
  bool every_head = true;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (set.has(i)) {
      heads_[i].put_in_set(set.sync.offset[i]);
      continue;
    }
    every_head = false;
    if (heads_[i].streaming()) every_present = false;
    heads_[i].missed_set(timing_.period());
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
  assembly_.offer(open.set);
  open.set = {};
  assembly_.collect();  // returns the frames at once if no outlet took the set
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

}  // namespace nodal::firmware
