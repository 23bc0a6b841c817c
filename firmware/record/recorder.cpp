#include "firmware/record/recorder.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "firmware/frame/drain.h"
#include "firmware/frame/pack_picture.h"
#include "protocol/take/limits.h"
#include "protocol/take/matroska_writer.h"
#include "protocol/take/tally.h"
#include "stitch/media/ut_video.h"

namespace nodal::firmware {
namespace {

/// Matroska stores times in these steps.
constexpr Duration kLongestRow = take::MatroskaWriter::kLongestCluster - take::MatroskaWriter::kTick;

take::Stream delivered_stream(const hal::FrameView& frame) {
  const ImageView& picture = frame.image;
  return {picture.format, picture.width, picture.height, picture.coding, frame.fields};
}

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
      raymaps_a_set_(config.raymap.raymaps_a_set()),
      raymap_format_(config.raymap.format),
      takes_(*config.takes),
      sets_in_(sets_in),
      encoder_(encoder),
      raymaps_in_(encoder.add_outlet(kRaymaps, false)),
      orders_(4),
      rows_(kRows + 1),
      rows_back_(kRows + 1),
      ring_(static_cast<std::size_t>(config.takes->buffer_mb) << 20) {
  std::ranges::transform(config.heads, modes_.begin(), &HeadConfig::take_mode);
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
    if (take_ && !ending_ && !not_for_still(*set)) record(*set);
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
      still_ = order.still;
      raymaps_ = order.raymaps;
      still_taken_.reset();
      still_since_.reset();
      streams_ = {};
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

/// Whether a still does not record this set: it has one, or it waits for one with every head. Ends a still whose
/// raymaps do not come.
bool Recorder::not_for_still(const FrameSet& set) {
  if (!still_) return false;
  if (!still_since_) still_since_ = set.mid_exposure;
  const bool waited = set.mid_exposure - *still_since_ >= kStillWaits.at(set.period);
  if (still_taken_) {
    if (waited) begin_end();
    return true;
  }
  bool all = true;
  for (std::size_t head = 0; head < heads_; ++head) all &= set.has(head);
  return !all && !waited;
}

bool Recorder::open_row() {
  if (row_) return true;
  if (spare_.empty()) return false;
  row_ = std::move(spare_.back());
  spare_.pop_back();
  row_->take = *take_;
  row_->streams = streams_;
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

/// Notes the formats of heads that are new, or have changed for long enough.
bool Recorder::changes_streams(const FrameSet& set) {
  bool changed = false;
  for (std::size_t head = 0; head < heads_; ++head) {
    if (!set.has(head)) continue;
    const take::Stream& stream = format_of(set.frames[head], head).stored;
    if (streams_[head] == stream) continue;
    if (streams_[head] && set.mid_exposure - stream_since_[head] < kFormatStays) continue;
    streams_[head] = stream;
    stream_since_[head] = set.mid_exposure;
    changed = true;
  }
  return changed;
}

/// A rate that was only measured a little better is none of its own.
bool Recorder::changes_rate(const FrameSet& set) { return !take::same_rate(std::exchange(rate_, set.rate), set.rate); }

void Recorder::record(const FrameSet& set) {
  const bool changed_rate = changes_rate(set);
  const bool changed = changes_streams(set) || changed_rate;
  if (row_ && !row_->sets.empty()) {
    const Duration since = set.mid_exposure - row_->sets.front().mid_exposure;
    bool full = changed || row_->sets.size() == TakeRow::kMaxSets || since >= kLongestRow;
    for (std::size_t head = 0; head < heads_; ++head) {
      if (!set.has(head)) continue;
      const std::size_t bytes = most_bytes(set.frames[head], format_of(set.frames[head], head).stored);
      full |= row_bytes_[head] + bytes > take::MatroskaWriter::kLargestCluster;
    }
    if (full) close_row(false);
  }
  if (row_ && row_->sets.empty()) {  // it has only raymaps
    row_->streams = streams_;
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
    still_since_ = set.mid_exposure;
    if (still_ && raymaps_) still_taken_ = Still{set.number, raymaps_a_set_};
    else if (still_) begin_end();
    // The next set belongs to another row in any case: this one goes to the disk now, and not when that set comes.
    else if (set.period >= kLongestRow) close_row(false);
    return;
  }
  row_->sets.pop_back();
  ring_.give_back(before);
  ++missed_;
  counts_.lost_sets.fetch_add(1, std::memory_order_relaxed);
  if (!row_->sets.empty()) close_row(false);  // what is in it leaves the ring
}

/// Computed when the head's format changes.
Recorder::HeadFormat& Recorder::format_of(const hal::FrameView& frame, std::size_t head) {
  const take::Stream delivered = delivered_stream(frame);
  std::optional<HeadFormat>& format = formats_[head];
  if (!format || format->delivered != delivered)
    format.emplace(HeadFormat{delivered, stored_stream(delivered, modes_[head], raymap_format_), std::nullopt});
  return *format;
}

std::size_t Recorder::most_bytes(const hal::FrameView& frame, const take::Stream& stored) {
  const ImageView& picture = frame.image;
  if (stored.lossless) return media::ut_video_most_bytes(stored.format, stored.width, stored.height);
  if (stored.format != PixelFormat::kMjpeg) return packed_size(stored.format, stored.width, stored.height);
  if (picture.format == PixelFormat::kMjpeg) return picture.bytes;
  const std::size_t raw = packed_size(picture.format, picture.width, picture.height);
  return raw + raw / 2;
}

int Recorder::quality_now() const {
  const int quarters = static_cast<int>(4 * ring_.used() / ring_.size());
  return std::min(takes_.quality, std::max(kMinQuality, takes_.quality - quarters * kQualityStep));
}

bool Recorder::store(const hal::FrameView& view, std::size_t head, RecordedFrame& to) {
  const ImageView& picture = view.image;
  HeadCoder::Parts parts{};
  HeadFormat& format = format_of(view, head);
  std::size_t bytes = most_bytes(view, format.stored);
  const bool recoded = format.stored != format.delivered;
  if (recoded) {
    if (!format.coder) format.coder.emplace(format.delivered, format.stored);
    if (format.stored.format == PixelFormat::kMjpeg) to.quality = quality_now();
    const auto coded = format.coder->code(picture, to.quality);
    if (!coded) {
      to.placeholder = Placeholder::kEncoder;
      return true;
    }
    parts = *coded;
    bytes = parts[0].size() + parts[1].size();
  }
  const auto place = ring_.take(bytes);
  if (!place) return false;
  if (recoded) std::ranges::copy(parts[1], std::ranges::copy(parts[0], place->begin()).out);
  else if (picture.format == PixelFormat::kMjpeg) std::memcpy(place->data(), picture.planes[0].data, bytes);
  else pack_picture(picture, place->data());
  to.placeholder = Placeholder::kNone;
  to.bytes = *place;
  return true;
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
      placeholders += streams_[head] ? 1 : 0;
      continue;
    }
    const hal::FrameView& view = set.frames[head];
    frame.offset = set.sync.offset[head];
    frame.in_effect = view.in_effect;
    frame.sequence = view.sequence;
    frame.placeholder = Placeholder::kFormat;
    const take::Stream& stored = format_of(view, head).stored;
    const bool fits = streams_[head] == stored && most_bytes(view, stored) <= take::kMaxTakePictureBytes;
    if (fits && !store(view, head, frame)) return false;
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
  if (!raymap.jpeg || (still_ && (!still_taken_ || still_taken_->set != raymap.info.set))) return;
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
  if (still_ && --still_taken_->raymaps == 0) begin_end();
}

}  // namespace nodal::firmware
