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
      adoptions_out_(4) {}

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
  raymap_ = {};
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
  blend_.run(band_of(ticket));
  bands_done_.fetch_add(1, std::memory_order_acq_rel);
  return true;
}

void Blender::start_round(std::uint64_t bands) {
  NODAL_ASSERT(bands <= kMostBands);
  bands_done_.store(0, std::memory_order_relaxed);
  next_band_.store((++round_ << 2 * kBandBits) | (bands << kBandBits), std::memory_order_release);
}

bool Blender::coordinate() {
  if (set_) {
    if (bands_done_.load(std::memory_order_acquire) < bands_of(next_band_.load(std::memory_order_relaxed)))
      return false;
    return next_round();
  }
  const bool adopted = adopt();
  return begin() || adopted;
}

/// Hands out the next pieces of work of the set.
bool Blender::next_round() {
  if (const auto round = blend_.next_round()) {
    start_round(round->pieces);
    return true;
  }
  if (raymap_.pixels) return finish();
  count_undecodable();
  if (blend_.views()) request_seams();
  begin_raymap();
  return true;
}

bool Blender::finish() {
  if (raymaps_out_.full()) return false;  // the encoder is behind
  times_.add(clock_.now() - begun_);
  raymaps_out_.push(std::move(raymap_));
  raymap_ = {};
  count(counts_.blended);
  if (field_ + 1 < blend_.plan()->tables.size()) {
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
  auto setup = tables_in_.pop();
  if (!setup) return false;
  if (sets::BlendSetup before = blend_.adopt(std::move(*setup))) tables_out_.push(std::move(before));
  adoption_unreported_ = true;
  seams_.restart();
  count(counts_.adopted);
  return true;
}

/// Puts the placed seams in force if they are due. Outdated ones are given back.
void Blender::move_seams(std::uint64_t set) {
  if (auto placed = seams_in_.pop()) seams_.placed(std::move(*placed));
  const sets::PlacedSeams* due = seams_.due(set);
  if (!due || (due->plan && tables_out_.full())) return;
  const bool outdated = seams_.outdated();
  if (!outdated && (seam_changes_out_.full() || seam_change_)) return;
  sets::PlacedSeams placed = seams_.take();
  if (placed.plan && outdated) {
    tables_out_.push({std::move(placed.plan), nullptr});
  } else if (placed.plan) {
    tables_out_.push({blend_.move_seams(std::move(placed.plan)), nullptr});
    count(counts_.seams_moved);
    log_seams(set);
  } else if (!placed.refused.empty()) {
    seams_refused_.publish(placed.refused);
    counts_.seams_refused.fetch_add(1, std::memory_order_release);  // after the reason, for its reader
  }
}

/// For takes: the seams in force from this set on. While the ring is full, no seams are placed, so a change that waits
/// for room is that of a new calibration to its own seams; further calibrations have their own seams, too, and need no
/// further record.
void Blender::log_seams(std::uint64_t set) {
  const sets::PlanPtr& plan = blend_.plan();
  if (logs_seams_ && plan->seams && !seam_change_) seam_change_ = SeamChange{set, plan->seam_labels};
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
    Adoption adoption{set->number, blend_.plan()->id};
    adoption_.publish(adoption);
    adoptions_out_.push(std::move(adoption));
    log_seams(set->number);
  }
  move_seams(set->number);
  if (seam_change_ && seam_changes_out_.push(std::move(*seam_change_))) seam_change_.reset();
  sets_begun_.store(set->number + 1, std::memory_order_release);
  bool ready = false;
  if (!blend_.plan()) {
    count(counts_.without_calibration);
  } else if (set->number % every_.load(std::memory_order_relaxed) != 0) {
    count(counts_.shed);
  } else if (ready = take_pixels(blend_.plan()->tables.size()); !ready) {
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
  return next_round();
}

void Blender::begin_blend() {
  std::array<sets::SetFrame, kMaxHeads> frames;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!set_->has(i)) continue;
    const hal::FrameView& frame = set_->frames[i];
    const hal::HeadSettings& in_effect = frame.in_effect;
    frames[i] = {true, frame.image, frame.fields, in_effect.exposure, in_effect.gain, in_effect.gamma.thousandths()};
  }
  const bool places = blend_.plan()->seams != nullptr;
  if (places && seams_.is_late(set_->number)) count(counts_.seams_late);
  const std::size_t unfit = blend_.begin(frames, places && seams_.wants(set_->number));
  counts_.unfit_frames.fetch_add(unfit, std::memory_order_relaxed);
}

void Blender::count_undecodable() {
  for (const auto& [head, fault] : blend_.decoded()) {
    undecodable_[head].now.store(fault, std::memory_order_relaxed);
    if (fault != decode::DecodeFault::kNone) count(undecodable_[head].frames);
  }
}

void Blender::request_seams() {
  seams_.begin(set_->number);
  const bool pushed = seams_out_.push({blend_.plan(), blend_.views()});
  NODAL_ASSERT(pushed);
}

void Blender::begin_raymap() {
  raymap_.pixels = std::exchange(pixels_[field_], {});
  blend_.begin_raymap(field_, raymap_.pixels.edit().data());
  raymap_.info = {set_->number, set_->mid_exposure, {}, set_->sync, blend_.heads(), blend_.plan()->id, {}, {}};
  raymap_.info.rate = set_->rate;
  raymap_.info.linear = blend_.linear();
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if ((blend_.heads() & head_bit(i)) != 0) raymap_.info.in_effect[i] = set_->frames[i].in_effect;
  }
  if (const auto parity = blend_.table().sources[0].field) {
    raymap_.info.field = FieldOfSet{static_cast<int>(field_), *parity};
    if (field_ == 1) raymap_.info.mid_exposure = set_->mid_exposure + set_->second_field;
  }
  next_round();
  if (field_ == 0) measure();  // while other threads blend; the set stays: only this thread can release it
}

void Blender::measure() {
  if (light_out_.full()) return;
  // The unprepared frames: other threads prepare pictures meanwhile.
  blend::SphereLight seen = blend::meter(blend_.plan()->meter, blend_.frames(), blend_.exposed());
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
