#include "firmware/frame_tap.h"

#include <cstring>

namespace nodal::firmware {
namespace {

void copy_picture(const ImageView& from, const MutableImageView& into) {
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(from.format)); ++c) {
    const PlaneView& source = from.planes[c];
    const MutablePlaneView& target = into.planes[c];
    for (int row = 0; row < source.height; ++row) {
      const std::uint8_t* read = source.data + row * source.row_stride;
      std::uint8_t* write = target.data + row * target.row_stride;
      if (source.pixel_stride == 1 && target.pixel_stride == 1) {
        std::memcpy(write, read, static_cast<std::size_t>(source.width));
        continue;
      }
      for (int i = 0; i < source.width; ++i) write[i * target.pixel_stride] = read[i * source.pixel_stride];
    }
  }
}

}  // namespace

bool FrameTap::want(TappedSet places) {
  if (state_.load(std::memory_order_acquire) != State::kIdle) return false;
  copy_ = std::move(places);
  state_.store(State::kWanted, std::memory_order_release);
  return true;
}

bool FrameTap::withdraw() {
  State wanted = State::kWanted;
  if (!state_.compare_exchange_strong(wanted, State::kIdle, std::memory_order_acq_rel)) return false;
  copy_ = {};
  return true;
}

std::optional<TappedSet> FrameTap::take() {
  if (state_.load(std::memory_order_acquire) != State::kFull) return std::nullopt;
  std::optional<TappedSet> taken(std::move(copy_));
  copy_ = {};
  state_.store(State::kIdle, std::memory_order_release);
  return taken;
}

void FrameTap::fill(const FrameSet& set, const Sha256* calibration) {
  State wanted = State::kWanted;
  if (!state_.compare_exchange_strong(wanted, State::kFilling, std::memory_order_acq_rel)) return;
  copy_.set = set.number;
  copy_.mid_exposure = set.mid_exposure;
  copy_.sync = set.sync;
  copy_.blended = calibration != nullptr;
  if (calibration) copy_.calibration = *calibration;
  copy_.heads = 0;
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if (!set.has(i) || (copy_.wanted & head_bit(i)) == 0) continue;
    TappedSet::Place& place = copy_.places[i];
    const ImageView& picture = set.frames[i].image;
    if (picture.format != place.format || picture.width != place.width || picture.height != place.height) continue;
    copy_picture(picture, packed_image(place.format, place.width, place.height, copy_.bytes->data() + place.offset));
    place.in_effect = set.frames[i].in_effect;
    copy_.heads |= head_bit(i);
  }
  state_.store(State::kFull, std::memory_order_release);
}

}  // namespace nodal::firmware
