#include "hal/linux/cable/receive_ring.h"

#include <algorithm>

namespace nodal::hal::cable {

void ReceiveRing::begin(std::uint16_t session) {
  NODAL_ASSERT(queued_ == 0);
  reader_ = RecordReader(session);
  payload_ = {};
  violation_.reset();
  stopped_ = false;
  next_ = 0;
  for (std::size_t slot = 0; slot < kTransfers; ++slot) {
    slots_[slot].bytes = {};
    queue(slot);
  }
}

void ReceiveRing::queue(std::size_t slot) {
  if (stopped_) return;
  if (!queue_(slot)) return stop();
  slots_[slot].queued = true;
  ++queued_;
}

void ReceiveRing::received(std::size_t slot, std::span<const std::uint8_t> bytes) {
  NODAL_ASSERT(slots_[slot].queued);
  slots_[slot].queued = false;
  slots_[slot].bytes = bytes;
  --queued_;
}

bool ReceiveRing::ready() const {
  return !payload_.empty() || std::any_of(slots_.begin(), slots_.end(), [](const Slot& s) { return !s.bytes.empty(); });
}

void ReceiveRing::advance() {
  std::size_t empty = 0;  // slots in a row without bytes, all that remain of a ring that was stopped
  while (payload_.empty()) {
    Slot& slot = slots_[next_];
    if (slot.queued || violation_ || empty == kTransfers) return;
    if (slot.bytes.empty()) {
      queue(next_);
      next_ = (next_ + 1) % kTransfers;
      ++empty;
      continue;
    }
    empty = 0;
    const auto next = reader_.next(slot.bytes);
    if (!next) {
      violation_ = next.error();
      return;
    }
    payload_ = *next;
  }
}

std::span<const std::uint8_t> ReceiveRing::next_bytes(std::size_t most) {
  advance();
  const auto taken = payload_.first(std::min(most, payload_.size()));
  payload_ = payload_.subspan(taken.size());
  return taken;
}

}  // namespace nodal::hal::cable
