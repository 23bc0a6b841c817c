#include "firmware/picture/blender.h"

#include <algorithm>
#include <utility>

#include "stitch/decode/frame_decoder.h"

namespace nodal::firmware {
namespace {

void count(std::atomic<std::uint64_t>& counter) { counter.fetch_add(1, std::memory_order_relaxed); }

/// The part of a head's frame that is blended: all of it, or the field that the source is for.
ImageView picture_of(const blend::BlendTable::Source& source, const ImageView& frame) {
  return source.field ? field_of(frame, *source.field) : frame;
}

/// `first` is the head's source in the first table, the one for the field exposed first.
bool has_fields_for(const blend::BlendTable::Source& first, const hal::FrameView& frame) {
  return !first.field || frame.fields == fields_from(*first.field);
}

}  // namespace

Blender::Blender(const RaymapConfig& config, hal::ClockPort& clock, Outlet<SetLoan>& sets_in)
    : config_(config),
      bands_(static_cast<std::uint64_t>((config.height + kBandRows - 1) / kBandRows)),
      clock_(clock),
      sets_in_(sets_in),
      pixels_pool_(kMaxBuffers),
      tables_in_(1),  // one entry: a full ring means that the newest calibration is not in force yet
      tables_out_(8),
      raymaps_out_(kRaymapsWaiting),
      light_out_(4),
      adoptions_out_(4) {
  NODAL_ASSERT(bands_ <= kMostBands);
}

bool Blender::step() {
  bool busy = run_band();
  if (!busy) {
    if (coordinating_.test_and_set(std::memory_order_acquire)) return false;
    busy = coordinate();
    coordinating_.clear(std::memory_order_release);
  }
  if (busy) count(progress_);
  return busy;
}

void Blender::close() {
  set_ = {};
  sets_in_.drop_waiting();
  next_band_.store(0);
  idle_.store(true);
}

bool Blender::run_band() {
  std::uint64_t ticket = next_band_.load(std::memory_order_acquire);
  for (;;) {
    if (band_of(ticket) >= bands_of(ticket)) return false;
    if (next_band_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel, std::memory_order_acquire)) {
      break;
    }
  }
  const blend::BlendTable& table = this->table();
  if (doing_ == Round::kDecode) {
    decode(band_of(ticket));
  } else if (doing_ == Round::kPrepare) {
    const ToPrepare& head = to_prepare_[band_of(ticket)];
    std::array<ImageView, blend::kMaxPictures> views;
    blend::prepare_picture(*head.source, head.picture, head.memory, views);
    for (std::size_t level = 0; level < head.source->pictures(); ++level) {
      pictures_[level * table.sources.size() + head.index] = views[level];
    }
  } else {
    const int row = static_cast<int>(band_of(ticket)) * kBandRows;
    blend::blend_rows(table, pictures_, tone_, into_, row, std::min(row + kBandRows, config_.height));
  }
  bands_done_.fetch_add(1, std::memory_order_acq_rel);
  return true;
}

void Blender::start_round(std::uint64_t bands) {
  bands_done_.store(0, std::memory_order_relaxed);
  next_band_.store((++round_ << 2 * kBandBits) | (bands << kBandBits), std::memory_order_release);
}

bool Blender::coordinate() {
  if (set_) {
    if (bands_done_.load(std::memory_order_acquire) < bands_of(next_band_.load(std::memory_order_relaxed)))
      return false;
    switch (doing_) {
      case Round::kDecode: begin_raymap(); break;
      case Round::kPrepare:
        doing_ = Round::kBlend;
        start_round(bands_);
        break;
      case Round::kBlend: return finish();
    }
    return true;
  }
  const bool adopted = adopt();
  return begin() || adopted;
}

bool Blender::finish() {
  if (raymaps_out_.full()) return false;  // the encoder is behind
  times_.add(clock_.now() - begun_);
  raymaps_out_.push(std::move(raymap_));
  raymap_ = {};
  count(counts_.blended);
  if (field_ + 1 < installed_->tables.size()) {
    ++field_;
    begun_ = clock_.now();
    begin_raymap();
    return true;
  }
  set_ = {};
  idle_.store(sets_in_.empty(), std::memory_order_release);
  return true;
}

bool Blender::adopt() {
  if (tables_out_.full() || adoptions_out_.full()) return false;
  auto installed = tables_in_.pop();
  if (!installed) return false;
  std::swap(installed_, *installed);
  if (*installed) tables_out_.push(std::move(*installed));
  adoption_unreported_ = true;
  count(counts_.adopted);
  return true;
}

bool Blender::begin() {
  auto next = sets_in_.take();
  if (!next) {
    idle_.store(true, std::memory_order_release);
    return false;
  }
  const SetLoan set = std::move(*next);
  idle_.store(false, std::memory_order_release);
  if (std::exchange(adoption_unreported_, false)) adoptions_out_.push({set->number, installed_->id});
  sets_begun_.store(set->number + 1, std::memory_order_release);
  bool ready = false;
  if (!installed_) {
    count(counts_.without_calibration);
  } else if (set->number % every_.load(std::memory_order_relaxed) != 0) {
    count(counts_.shed);
  } else if (ready = take_pixels(installed_->tables.size()); !ready) {
    count(counts_.without_buffer);
  }
  if (!ready) return true;
  set_ = set;
  field_ = 0;
  begun_ = clock_.now();
  take_frames(*set_);
  if (heads_to_decode_ == 0) {
    begin_raymap();
  } else {
    doing_ = Round::kDecode;
    start_round(heads_to_decode_);
  }
  return true;
}

/// Notes which frames of the set are blended, and which are decoded before.
void Blender::take_frames(const FrameSet& set) {
  heads_to_decode_ = 0;
  const auto& decoders = installed_->decoders;
  for (std::size_t i = 0; i < decoders.size(); ++i) {
    frames_[i] = {};
    if (!set.has(i)) continue;
    if (!decoders[i]->takes(set.frames[i].image) || !has_fields_for(installed_->tables[0].sources[i], set.frames[i])) {
      count(counts_.unfit_frames);
      continue;
    }
    frames_[i] = set.frames[i].image;
    if (decoders[i]->needed(frames_[i])) to_decode_[heads_to_decode_++] = i;
  }
}

void Blender::decode(std::uint64_t band) {
  const std::size_t head = to_decode_[band];
  const ImageView frame = frames_[head];
  const decode::DecodeFault fault = installed_->decoders[head]->decode(frame, frames_[head]);
  undecodable_[head].now.store(fault, std::memory_order_relaxed);
  if (fault != decode::DecodeFault::kNone) count(undecodable_[head].frames);
}

void Blender::begin_raymap() {
  const blend::BlendTable& table = this->table();
  raymap_.info = {set_->number, set_->mid_exposure, {}, set_->sync, 0, installed_->id, {}, {}};
  if (const auto parity = table.sources[0].field) {
    raymap_.info.field = FieldOfSet{static_cast<int>(field_), *parity};
    if (field_ == 1) raymap_.info.mid_exposure = set_->mid_exposure + set_->second_field;
  }
  raymap_.pixels = std::exchange(pixels_[field_], {});
  into_ = packed_image(table.format, table.width, table.height, raymap_.pixels.edit().data());
  take_pictures(*set_);
  undo_exposures(*set_);
  doing_ = heads_to_prepare_ > 0 ? Round::kPrepare : Round::kBlend;
  start_round(heads_to_prepare_ > 0 ? heads_to_prepare_ : bands_);
  if (field_ == 0) measure();  // while other threads blend; the set stays: only this thread can release it
}

void Blender::take_pictures(const FrameSet& set) {
  const blend::BlendTable& table = this->table();
  std::uint8_t* memory = installed_->prepared->data();
  heads_to_prepare_ = 0;
  for (std::size_t i = 0; i < table.sources.size(); ++i) {
    const blend::BlendTable::Source& source = table.sources[i];
    const std::size_t bytes = blend::prepared_size(source);
    std::uint8_t* own_memory = memory;
    memory += bytes;
    pictures_[i] = {};
    if (frames_[i].planes[0].data == nullptr) continue;
    const ImageView picture = picture_of(source, frames_[i]);
    raymap_.info.heads |= head_bit(i);
    raymap_.info.in_effect[i] = set.frames[i].in_effect;
    pictures_[i] = picture;
    if (bytes > 0) to_prepare_[heads_to_prepare_++] = {&source, picture, own_memory, i};
  }
}

/// A missing head counts with its last exposure, so that the brightness of the others does not jump when it disappears.
void Blender::undo_exposures(const FrameSet& set) {
  const std::size_t heads = table().sources.size();
  bool known = installed_->exposures.heads.size() == heads;
  for (std::size_t i = 0; i < heads; ++i) {
    if (set.has(i)) {
      const hal::HeadSettings& in_effect = set.frames[i].in_effect;
      exposed_[i] = {stops_of(in_effect.exposure) + stops_of(in_effect.gain), in_effect.gamma.thousandths()};
      was_exposed_ |= head_bit(i);
    }
    known = known && (was_exposed_ & head_bit(i)) != 0;
  }
  if (is_linear16(table().format)) {
    const auto as_calibrated = decltype(exposed_){};
    const std::span<const blend::ExposedHead> exposed(known ? exposed_ : as_calibrated);
    tone_ = blend::linear_tone(table(), installed_->exposures, exposed.first(heads));
    raymap_.info.linear = blend::linear_scale(installed_->exposures, tone_, exposed.first(heads));
    if (!known) raymap_.info.linear->full.reset();
    return;
  }
  tone_ = known ? blend::tone_of_exposures(table(), installed_->exposures, exposed_) : installed_->tone;
}

void Blender::measure() {
  if (light_out_.full()) return;
  // The unprepared frames: other threads change pictures_ meanwhile.
  blend::SphereLight seen = blend::meter(installed_->meter, frames_, exposed_);
  seen.set = set_->number;
  light_out_.push(std::move(seen));
}

/// Takes a buffer for each raymap of a set; false when the pool has too few.
bool Blender::take_pixels(std::size_t wanted) {
  for (std::size_t i = 0; i < wanted; ++i) {
    if (pixels_[i]) continue;  // taken for an earlier set, for which the pool then had no second buffer
    pixels_[i] = pixels_pool_.take();
    if (!pixels_[i]) return false;
    // A buffer of the pool that was never used before.
    if (pixels_[i]->empty()) pixels_[i].edit().resize(packed_size(config_.format, config_.width, config_.height));
  }
  return true;
}

}  // namespace nodal::firmware
