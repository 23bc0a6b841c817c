// The part of Capture that groups frames into sets.
#include <array>
#include <utility>

#include "firmware/capture/capture.h"
#include "firmware/capture/capture_log.h"

namespace nodal::firmware {
namespace {

/// A frame's exposure ends before its last byte arrives, and not long before. Otherwise the head's clock has wrapped or
/// was set; accepting one such frame would close sets of the future and make every later frame too late.
bool plausible(const hal::FrameView& frame, Duration period) {
  const Duration age = frame.received - frame.mid_exposure;
  return age >= Duration() && age <= Capture::kOldest + period * Capture::kMaxOpenSets;
}

bool complete(const FrameSet& set, const std::deque<CaptureHead>& heads) {
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (!set.has(i) && heads[i].expected()) return false;
  }
  return true;
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

void Capture::place(std::size_t head, const hal::FrameView& frame) {
  if (!plausible(frame, pace_.timing().period())) return heads_[head].lose(frame, LossReason::kBadTime);
  const auto match = pace_.match(head, frame, now_);
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
  }
  heads_[head].hold(frame);
  pace_.on_frame(head, *match, frame, heads_[head].starts());
}

bool Capture::close_complete_sets() {
  bool any = false;
  while (!assembly_.empty() && complete(*assembly_.oldest().set, heads_)) {
    close_oldest();
    any = true;
  }
  return any;
}

Instant Capture::due() const {
  const SetTiming& timing = pace_.timing();
  return timing.middle_of(assembly_.oldest().slot) + timing.period() * kHalfPeriodsToWait / 2;
}

bool Capture::close_due_sets(Instant now) {
  bool any = close_complete_sets();
  while (!assembly_.empty()) {
    if (now < due()) break;
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
  pace_.describe(open.slot, set, open.skews);
  set.number = report_.sets++;
  set.period = pace_.timing().period();
  bool every_present = true;
  bool every_head = true;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (set.has(i)) {
      heads_[i].put_in_set(set.sync.offset[i]);
      continue;
    }
    every_head = false;
    if (heads_[i].streaming()) every_present = false;
    heads_[i].missed_set(set.period);
  }
  if (every_head) ++report_.full_sets;
  pace_.on_set(set, open.skews, every_present, now_);
  set.sync.state = pace_.state();
  if (log_) log_->note(SetClosed{set.number, set.mid_exposure, set.mask, set.sync});
  assembly_.offer(open.set);
  open.set = {};
  assembly_.collect();  // returns the frames at once if no outlet took the set
}

}  // namespace nodal::firmware
