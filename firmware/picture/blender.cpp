#include "firmware/picture/blender.h"

#include <algorithm>
#include <utility>

#include "stitch/decode/frame_decoder.h"

namespace nodal::firmware {
namespace {

void count(std::atomic<std::uint64_t>& counter) { counter.fetch_add(1, std::memory_order_relaxed); }

}  // namespace

Blender::Blender(const RaymapConfig& config, hal::ClockPort& clock, Outlet<SetLoan>& sets_in)
    : clock_(clock), sets_in_(sets_in), raymaps_out_(kRaymapsWaiting), light_out_(4), buffers_(config, kMaxBuffers) {}

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
  bands_.start(0);
  idle_.store(true);
}

bool Blender::run_band() {
  const auto band = bands_.take();
  if (!band) return false;
  blend_.run(*band);
  bands_.done();
  return true;
}

bool Blender::coordinate() {
  if (set_) {
    return bands_.all_done() && next_round();
  }
  const bool adopted = adopt();
  return begin() || adopted;
}

/// Hands out the next pieces of work of the set.
bool Blender::next_round() {
  if (const auto round = blend_.next_round()) {
    bands_.start(round->pieces);
    return true;
  }
  if (raymap_.pixels) return finish();
  count_undecodable();
  seams_.place(set_->number, blend_);
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
  if (!swap_.adopt(blend_)) return false;
  seams_.restart();
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
  const bool first = swap_.report(set->number, blend_);
  seams_.begin(set->number, first, blend_, swap_.tables_out());
  bool ready = false;
  if (!blend_.plan()) {
    count(counts_.without_calibration);
  } else if (set->number % every_.load(std::memory_order_relaxed) != 0) {
    count(counts_.shed);
  } else if (ready = buffers_.reserve(blend_.plan()->tables.size()); !ready) {
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
  const std::size_t unfit = blend_.begin(frames, seams_.wants_views(set_->number, *blend_.plan()));
  counts_.unfit_frames.fetch_add(unfit, std::memory_order_relaxed);
}

void Blender::count_undecodable() {
  for (const auto& [head, fault] : blend_.decoded()) {
    counts_.undecodable[head].now.store(fault, std::memory_order_relaxed);
    if (fault != decode::DecodeFault::kNone) count(counts_.undecodable[head].frames);
  }
}

void Blender::begin_raymap() {
  raymap_.pixels = buffers_.take(field_);
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

}  // namespace nodal::firmware
