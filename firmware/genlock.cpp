#include "firmware/genlock.h"

#include <algorithm>

namespace nodal::firmware {

Status Genlock::start(const hal::TriggerSettings& settings, Instant now) {
  if (!port_) return fail(Errc::kNoSuchDevice, "this rig has no trigger, so its heads cannot be genlocked");
  port_->stop();
  if (Status started = port_->start(settings); !started) {
    state_ = GenlockState::kOff;
    return fail(started.error().in("trigger"));
  }
  settings_ = settings;
  state_ = GenlockState::kAcquiring;
  failed_ = false;
  newest_edge_ = now;
  newest_set_.reset();
  edges_ = next_number_ = missing_ = 0;
  good_sets_ = 0;
  was_locked_ = false;
  spread_ = spread_worst_ = Duration();
  return {};
}

void Genlock::stop() {
  if (port_) port_->stop();
  state_ = GenlockState::kOff;
  good_sets_ = 0;
}

std::optional<hal::TriggerEdge> Genlock::take_edge() {
  if (!running() || failed_) return std::nullopt;
  auto edge = port_->take_edge();
  if (!edge) {
    failed_ = true;
    lose();
    return std::nullopt;
  }
  if (!*edge) return std::nullopt;
  newest_edge_ = std::max(newest_edge_, (*edge)->at);
  ++edges_;
  missing_ += (*edge)->number - std::min((*edge)->number, next_number_);
  next_number_ = (*edge)->number + 1;
  return **edge;
}

void Genlock::step(Instant now) {
  if (!running()) return;
  const Duration period = settings_.rate.period();
  if (now - newest_edge_ > period * 5 / 2) lose();
  // Acquiring, heads may take long to start; once locked, silence is a loss.
  if (state_ == GenlockState::kLocked && newest_set_ && now - *newest_set_ > period * 3) lose();
}

void Genlock::lose() {
  good_sets_ = 0;
  if (running()) state_ = GenlockState::kLost;
}

bool Genlock::is_good(const Skews& skews) {
  const Duration middle = skews.earliest + (skews.latest - skews.earliest) / 2;
  if (good_sets_ == 0 && !was_locked_) latency_ = middle;
  const Duration crept = middle - latency_;
  return skews.latest - skews.earliest <= kLockLimit && crept <= kLockLimit && -crept <= kLockLimit;
}

void Genlock::on_set(const FrameSet& set, const std::optional<Skews>& skews, bool every_present_head, Instant now) {
  if (!running() || failed_) return;
  newest_set_ = now;
  if (every_present_head) spread_ = set.sync.spread;
  const bool overdue = now - newest_edge_ > settings_.rate.period() * 5 / 2;
  if (overdue || !skews || !is_good(*skews)) {
    if (state_ == GenlockState::kLocked) lose();
    good_sets_ = 0;
    return;
  }
  if (++good_sets_ >= kSetsToLock) state_ = GenlockState::kLocked;
  was_locked_ |= state_ == GenlockState::kLocked;
  if (state_ == GenlockState::kLocked) spread_worst_ = std::max(spread_worst_, set.sync.spread);
}

GenlockReport Genlock::report() const {
  return {state_, settings_.rate, edges_, missing_, spread_, spread_worst_};
}

}  // namespace nodal::firmware
