#include "firmware/record/recorder.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "firmware/frame/drain.h"
#include "protocol/take/matroska_writer.h"
#include "protocol/take/tally.h"

namespace nodal::firmware {
namespace {

/// Matroska stores times in these steps.
constexpr Duration kLongestRow = take::MatroskaWriter::kLongestCluster - take::MatroskaWriter::kTick;

}  // namespace

std::string_view placeholder_name(Placeholder reason) {
  switch (reason) {
    case Placeholder::kNone: return "";
    case Placeholder::kMissing: return "missing";
    case Placeholder::kFormat: return "format";
    case Placeholder::kEncoder: return "encoder";
  }
  return "";
}

Recorder::Recorder(const RigConfig& config, Outlet<SetLoan>& sets_in, EncodeStage& encoder)
    : heads_(config.heads.size()),
      quality_(config.takes->quality),
      sets_in_(sets_in),
      encoder_(encoder),
      raymaps_in_(encoder.add_outlet(kRaymaps, false)),
      orders_(4),
      rows_(kRows + 1),
      rows_back_(kRows + 1),
      ring_(static_cast<std::size_t>(config.takes->buffer_mb) << 20),
      still_(config.heads.size(), config.raymap.raymaps_a_set()),
      streams_(config) {
  for (std::size_t k = 0; k < kRows; ++k) {
    spare_.push_back(std::make_unique<TakeRow>());
    spare_.back()->sets.reserve(TakeRow::kMaxSets);
    spare_.back()->raymaps.reserve(2 * TakeRow::kMaxSets);
  }
}

bool Recorder::step() {
  drain(rows_back_, [&](std::unique_ptr<TakeRow> row) { spare_.push_back(std::move(row)); });
  bool busy = run_orders();
  busy |= drain(sets_in_, [&](const SetLoan& set) {
    if (!take_ || ending_) return;
    const Still::Use use = still_.use_of(*set);
    if (use == Still::Use::kRecord) record(*set);
    if (use == Still::Use::kEnd) begin_end();
  });
  busy |= drain(raymaps_in_, [&](const Raymap& raymap) {
    if (take_ && !ending_) record(raymap);
  });
  if (ending_ && open_row()) {
    close_row(true);
    ending_ = false;
    take_.reset();
    busy = true;
  }
  return busy;
}

bool Recorder::run_orders() {
  return drain(orders_, [&](const RecordOrder& order) {
    if (order.kind == RecordOrder::Kind::kBegin) {
      take_ = order.take;
      still_.begin(order.still, order.raymaps);
      streams_.begin();
      missed_ = 0;
      sets_in_.drop_waiting();
      raymaps_in_.drop_waiting();
      sets_in_.set_open(true);
      raymaps_in_.set_open(order.raymaps);
      encoder_.set_recording(order.raymaps);
    } else if (take_) {
      begin_end();
    }
  });
}

void Recorder::begin_end() {
  sets_in_.set_open(false);
  raymaps_in_.set_open(false);
  encoder_.set_recording(false);
  ending_ = true;
}

bool Recorder::open_row() {
  if (row_) return true;
  if (spare_.empty()) return false;
  row_ = std::move(spare_.back());
  spare_.pop_back();
  row_->take = *take_;
  row_->streams = streams_.in_take();
  row_->rate = rate_;
  row_->sets.clear();
  row_->raymaps.clear();
  row_->last = false;
  row_bytes_ = {};
  return true;
}

void Recorder::close_row(bool last) {
  row_->last = last;
  row_->ring_end = ring_.taken();
  const bool pushed = rows_.push(std::move(row_));
  NODAL_ASSERT(pushed);  // it has room for all rows
  row_.reset();
}

/// A rate that was only measured a little better is none of its own.
bool Recorder::changes_rate(const FrameSet& set) { return !take::same_rate(std::exchange(rate_, set.rate), set.rate); }

void Recorder::record(const FrameSet& set) {
  const bool changed_rate = changes_rate(set);
  const bool changed = streams_.follow(set) || changed_rate;
  if (row_ && !row_->sets.empty()) {
    const Duration since = set.mid_exposure - row_->sets.front().mid_exposure;
    bool full = changed || row_->sets.size() == TakeRow::kMaxSets || since >= kLongestRow;
    for (std::size_t head = 0; head < heads_; ++head) {
      if (!set.has(head)) continue;
      full |= row_bytes_[head] + streams_.most_bytes(set.frames[head], head) > take::MatroskaWriter::kLargestCluster;
    }
    if (full) close_row(false);
  }
  if (row_ && row_->sets.empty()) {  // it has only raymaps
    row_->streams = streams_.in_take();
    row_->rate = rate_;
  }
  const std::uint64_t before = ring_.taken();
  if (!open_row()) {
    ++missed_;
    counts_.lost_sets.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  if (row_->sets.empty()) row_->second_field = set.second_field;
  RecordedSet& to = row_->sets.emplace_back();
  if (copy(set, to)) {
    to.missed = std::exchange(missed_, 0);
    counts_.sets.fetch_add(1, std::memory_order_relaxed);
    if (still_.on_recorded(set)) begin_end();
    // The next set belongs to another row in any case: this one goes to the disk now, and not when that set comes.
    if (!still_.wanted() && set.period >= kLongestRow) close_row(false);
    return;
  }
  row_->sets.pop_back();
  ring_.give_back(before);
  ++missed_;
  counts_.lost_sets.fetch_add(1, std::memory_order_relaxed);
  if (!row_->sets.empty()) close_row(false);  // what is in it leaves the ring
}

int Recorder::quality_now() const {
  const int quarters = static_cast<int>(4 * ring_.used() / ring_.size());
  return std::min(quality_, std::max(kMinQuality, quality_ - quarters * kQualityStep));
}

bool Recorder::copy(const FrameSet& set, RecordedSet& to) {
  to.number = set.number;
  to.mid_exposure = set.mid_exposure;
  to.sync = set.sync;
  std::uint64_t placeholders = 0;
  for (std::size_t head = 0; head < heads_; ++head) {
    RecordedFrame& frame = to.frames[head];
    frame = {};
    if (!set.has(head)) {
      placeholders += streams_.in_take()[head] ? 1 : 0;
      continue;
    }
    const hal::FrameView& view = set.frames[head];
    frame.offset = set.sync.offset[head];
    frame.in_effect = view.in_effect;
    frame.sequence = view.sequence;
    if (!streams_.store(view, head, quality_now(), ring_, frame)) return false;
    if (frame.placeholder != Placeholder::kNone) ++placeholders;
  }
  std::uint64_t bytes = 0;
  for (std::size_t head = 0; head < heads_; ++head) {
    row_bytes_[head] += to.frames[head].bytes.size();
    bytes += to.frames[head].bytes.size();
  }
  counts_.set_bytes.store(bytes, std::memory_order_relaxed);
  counts_.placeholders.fetch_add(placeholders, std::memory_order_relaxed);
  return true;
}

void Recorder::record(const Raymap& raymap) {
  if (!raymap.jpeg || !still_.takes_raymap(raymap.info.set)) return;
  const std::vector<std::uint8_t>& jpeg = *raymap.jpeg;
  const bool room = ring_.used() + jpeg.size() <= ring_.size() / 100 * kRaymapsUpTo && open_row() &&
                    row_->raymaps.size() < row_->raymaps.capacity();
  const auto place = room ? ring_.take(jpeg.size()) : std::nullopt;
  if (!place) {
    counts_.lost_raymaps.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  std::memcpy(place->data(), jpeg.data(), jpeg.size());
  row_->raymaps.push_back({raymap.info.set, raymap.info.mid_exposure, *place});
  if (still_.on_raymap()) begin_end();
}

}  // namespace nodal::firmware
