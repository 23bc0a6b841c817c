#include "firmware/picture/encoder.h"

namespace nodal::firmware {

EncodeStage::EncodeStage(const RaymapConfig& config, hal::ClockPort& clock, SpscRing<Raymap>& raymaps_in)
    : config_(config),
      clock_(clock),
      raymaps_in_(raymaps_in),
      jpegs_(kMaxBuffers),
      published_(outlets_.add(kPublished)),
      jpeg_(config) {}

bool EncodeStage::step() {
  if (published_.full()) return false;
  auto raymap = raymaps_in_.pop();
  if (!raymap) return false;
  raymap->shed = steps() % every_.load(std::memory_order_relaxed) != 0;
  if ((wanted_.load(std::memory_order_relaxed) || recording_.load(std::memory_order_relaxed)) && !raymap->shed) {
    if (JpegLoan buffer = jpegs_.take()) {
      const Instant begun = clock_.now();
      const std::uint8_t* pixels = raymap->pixels->data();
      if (jpeg_.encode(packed_image(config_.format, config_.width, config_.height, pixels), raymap->info,
                       buffer.edit())) {
        times_.add(clock_.now() - begun);
      } else {
        failed_.fetch_add(1, std::memory_order_relaxed);
        buffer = {};
      }
      raymap->jpeg = std::move(buffer);
    }
  }
  if (!pixels_wanted_.load(std::memory_order_relaxed)) raymap->pixels = {};
  outlets_.offer(*raymap);
  passed_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

}  // namespace nodal::firmware
