#include "firmware/capture/set_assembly.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "firmware/capture/capture_log.h"

namespace nodal::firmware {

SetAssembly::SetAssembly(std::function<void(FrameSet&, std::uint32_t)> returned) : returned_(std::move(returned)) {
  open_.reserve(kMaxOpenSets);
}

Outlet<SetLoan>& SetAssembly::add_outlet(const OutletSpec& spec, bool open) {
  NODAL_ASSERT(!sets_);
  return outlets_.add(spec, open);
}

void SetAssembly::begin_step() {
  collections_ = 0;
  if (sets_) return;
  // One more than can be held, because a new set is opened before the oldest one is closed.
  sets_.emplace(kMaxOpenSets + outlets_.held_at_most() + 1, [this](FrameSet& set) { returned_(set, collections_); });
}

void SetAssembly::note_collection() {
  ++collections_;
  if (log_) log_->collecting(collections_);
}

bool SetAssembly::collect() {
  if (!sets_) return false;
  note_collection();
  return sets_->collect();
}

SetAssembly::OpenSet* SetAssembly::find(SetClock::Slot slot) {
  const auto found = std::ranges::find(open_, slot, &OpenSet::slot);
  return found == open_.end() ? nullptr : &*found;
}

bool SetAssembly::must_close_for(SetClock::Slot slot) const {
  return open_.size() == kMaxOpenSets && slot > open_.front().slot;
}

SetAssembly::OpenSet* SetAssembly::open(SetClock::Slot slot) {
  if (open_.size() == kMaxOpenSets) return nullptr;
  note_collection();
  SetLoan set = sets_->take();
  if (!set) return nullptr;
  set.edit().sync = {};
  const auto at = std::ranges::upper_bound(open_, slot, {}, &OpenSet::slot);
  return &*open_.insert(at, OpenSet{slot, std::move(set), {}});
}

SetAssembly::OpenSet SetAssembly::close_oldest() {
  OpenSet oldest = std::move(open_.front());
  open_.erase(open_.begin());
  newest_closed_ = oldest.slot;
  return oldest;
}

std::uint64_t SetAssembly::held() const {
  std::uint64_t held = 0;
  for (const OpenSet& open : open_) held += static_cast<std::uint64_t>(std::popcount(open.set->mask));
  return held;
}

}  // namespace nodal::firmware
