#include "firmware/encoder.h"

namespace nodal::firmware {

EncodeStage::EncodeStage(const RaymapConfig& config, hal::ClockPort& clock, SpscRing<Raymap>& raymaps_in,
                         SpscRing<Buffer>& pixels_unread)
    : config_(config),
      clock_(clock),
      raymaps_in_(raymaps_in),
      pixels_unread_(pixels_unread),
      raymaps_out_(kRaymapsWaiting),
      jpegs_free_(kMaxBuffers),
      jpeg_(config) {}

bool EncodeStage::step() {
  if (raymaps_out_.full()) return false;
  auto raymap = raymaps_in_.pop();
  if (!raymap) return false;
  raymap->shed = steps() % every_.load(std::memory_order_relaxed) != 0;
  if (wanted_.load(std::memory_order_relaxed) && !raymap->shed) {
    Buffer buffer = take_buffer();
    if (buffer) {
      const Instant begun = clock_.now();
      const std::uint8_t* pixels = raymap->pixels->data();
      if (jpeg_.encode(packed_image(config_.format, config_.width, config_.height, pixels), raymap->info, *buffer)) {
        times_.add(clock_.now() - begun);
      } else {
        failed_.fetch_add(1, std::memory_order_relaxed);
        buffer->clear();  // still passed on, so that it comes back to the pool
      }
      raymap->jpeg = std::move(buffer);
    }
  }
  if (!pixels_wanted_.load(std::memory_order_relaxed)) {
    NODAL_ASSERT(pixels_unread_.push(std::move(raymap->pixels)));
    raymap->pixels = nullptr;
  }
  raymaps_out_.push(std::move(*raymap));
  passed_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

Buffer EncodeStage::take_buffer() {
  if (auto free = jpegs_free_.pop()) return std::move(*free);
  if (buffers_made_ == kMaxBuffers) return nullptr;
  ++buffers_made_;  // only when clients hold more than ever before
  return std::make_shared<std::vector<std::uint8_t>>();
}

}  // namespace nodal::firmware
