#include "firmware/picture/blender.h"

#include <algorithm>
#include <utility>

#include "stitch/decode/frame_decoder.h"

namespace nodal::firmware {
namespace {

void count(std::atomic<std::uint64_t>& counter) { counter.fetch_add(1, std::memory_order_relaxed); }

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
      seams_out_(1),
      seams_in_(1),
      seam_changes_out_(kSeamChangesWaiting),
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
  if (doing_ == Round::kDecode) {
    decode(band_of(ticket));
  } else if (doing_ == Round::kView) {
    blend_.view(band_of(ticket));
  } else if (doing_ == Round::kPrepare) {
    blend_.prepare(band_of(ticket));
  } else {
    const int row = static_cast<int>(band_of(ticket)) * kBandRows;
    blend_.blend(row, std::min(row + kBandRows, config_.height));
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
      case Round::kDecode: begin_views(); break;
      case Round::kView:
        NODAL_ASSERT(seams_out_.push({blend_.installed(), set_->number}));
        begin_raymap();
        break;
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
  if (field_ + 1 < blend_.installed()->tables.size()) {
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
  if (sets::InstalledPtr before = blend_.adopt(std::move(*installed))) tables_out_.push(std::move(before));
  adoption_unreported_ = true;
  seams_period_.reset();
  count(counts_.adopted);
  return true;
}

/// Puts the placed seams in force if their period has begun. Seams for a calibration that was replaced meanwhile are
/// given back.
void Blender::adopt_seams(std::uint64_t set) {
  if (!placing_seams_) return;
  if (!seams_) seams_ = seams_in_.pop();
  if (!seams_) return;
  const bool stale = !seams_period_;
  if (!stale && (sets::seam_period(set) == *seams_period_ || seam_changes_out_.full() || seam_change_)) return;
  if (seams_->installed) {
    if (tables_out_.full()) return;
    if (stale) {
      tables_out_.push(std::move(seams_->installed));
    } else {
      tables_out_.push(blend_.adopt(std::move(seams_->installed)));
      count(counts_.seams_moved);
      log_seams(set);
    }
  } else if (!seams_->refused.empty()) {
    seams_refused_.publish(seams_->refused);
    counts_.seams_refused.fetch_add(1, std::memory_order_release);  // after the reason, for its reader
  }
  seams_.reset();
  placing_seams_ = false;
}

/// For takes: the seams in force from this set on. While the ring is full, no seams are placed, so a change that waits for room is
/// that of a new calibration to its own seams; further calibrations have their own seams, too, and need no further record.
void Blender::log_seams(std::uint64_t set) {
  const sets::InstalledPtr& installed = blend_.installed();
  if (logs_seams_ && installed->seams && !seam_change_) seam_change_ = SeamChange{set, installed->seam_labels};
}

bool Blender::begin() {
  auto next = sets_in_.take();
  if (!next) {
    idle_.store(true, std::memory_order_release);
    return false;
  }
  const SetLoan set = std::move(*next);
  idle_.store(false, std::memory_order_release);
  if (std::exchange(adoption_unreported_, false)) {
    Adoption adoption{set->number, blend_.installed()->id};
    adoption_.publish(adoption);
    adoptions_out_.push(std::move(adoption));
    log_seams(set->number);
  }
  adopt_seams(set->number);
  if (seam_change_ && seam_changes_out_.push(std::move(*seam_change_))) seam_change_.reset();
  sets_begun_.store(set->number + 1, std::memory_order_release);
  bool ready = false;
  if (!blend_.installed()) {
    count(counts_.without_calibration);
  } else if (set->number % every_.load(std::memory_order_relaxed) != 0) {
    count(counts_.shed);
  } else if (ready = take_pixels(blend_.installed()->tables.size()); !ready) {
    count(counts_.without_buffer);
  }
  if (!ready) {
    idle_.store(sets_in_.empty(), std::memory_order_release);
    return true;
  }
  set_ = set;
  field_ = 0;
  begun_ = clock_.now();
  begin_blend();
  if (blend_.to_decode() == 0) {
    begin_views();
  } else {
    doing_ = Round::kDecode;
    start_round(blend_.to_decode());
  }
  return true;
}

void Blender::begin_blend() {
  std::array<sets::SetFrame, kMaxHeads> frames;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!set_->has(i)) continue;
    const hal::FrameView& frame = set_->frames[i];
    const hal::HeadSettings& in_effect = frame.in_effect;
    frames[i] = {true, frame.image, frame.fields, in_effect.exposure, in_effect.gain, in_effect.gamma.thousandths()};
  }
  counts_.unfit_frames.fetch_add(blend_.begin(frames), std::memory_order_relaxed);
}

void Blender::decode(std::uint64_t band) {
  const auto [head, fault] = blend_.decode(band);
  undecodable_[head].now.store(fault, std::memory_order_relaxed);
  if (fault != decode::DecodeFault::kNone) count(undecodable_[head].frames);
}

/// The heads' views, in the first set of every period; then the raymap.
void Blender::begin_views() {
  const std::uint64_t period = sets::seam_period(set_->number);
  if (!blend_.installed()->seams || seams_period_ == period) return begin_raymap();
  if (placing_seams_) {
    if (std::exchange(late_period_, period) != period) count(counts_.seams_late);
    return begin_raymap();
  }
  blend_.begin_views();
  if (blend_.to_view() == 0) return begin_raymap();
  seams_period_ = period;
  placing_seams_ = true;
  doing_ = Round::kView;
  start_round(blend_.to_view());
}

void Blender::begin_raymap() {
  raymap_.pixels = std::exchange(pixels_[field_], {});
  blend_.begin_raymap(field_, raymap_.pixels.edit().data());
  raymap_.info = {set_->number, set_->mid_exposure, {}, set_->sync, blend_.heads(), blend_.installed()->id, {}, {}};
  raymap_.info.rate = set_->rate;
  raymap_.info.linear = blend_.linear();
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if ((blend_.heads() & head_bit(i)) != 0) raymap_.info.in_effect[i] = set_->frames[i].in_effect;
  }
  if (const auto parity = blend_.table().sources[0].field) {
    raymap_.info.field = FieldOfSet{static_cast<int>(field_), *parity};
    if (field_ == 1) raymap_.info.mid_exposure = set_->mid_exposure + set_->second_field;
  }
  doing_ = blend_.to_prepare() > 0 ? Round::kPrepare : Round::kBlend;
  start_round(blend_.to_prepare() > 0 ? blend_.to_prepare() : bands_);
  if (field_ == 0) measure();  // while other threads blend; the set stays: only this thread can release it
}

void Blender::measure() {
  if (light_out_.full()) return;
  // The unprepared frames: other threads prepare pictures meanwhile.
  blend::SphereLight seen = blend::meter(blend_.installed()->meter, blend_.frames(), blend_.exposed());
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
