#include "firmware/record/segment_writer.h"

#include <algorithm>
#include <utility>

#include "firmware/record/segment_track.h"
#include "protocol/base/try.h"
#include "protocol/take/seam_map.h"

namespace nodal::firmware {
namespace {

using take::PieceHashes;
using Bytes = std::vector<std::uint8_t>;

std::string bytes_of(std::span<const take::Xxh128> hashes) {
  std::string bytes;
  for (const take::Xxh128& hash : hashes) bytes.append(hash.begin(), hash.end());
  return bytes;
}

}  // namespace

SegmentWriter::~SegmentWriter() {
  for (const File& file : files_) place_.disk->close(file.handle);
  place_.disk->close(evidence_.handle);
}

Result<std::unique_ptr<SegmentWriter>> SegmentWriter::create(const TakePlace& place, std::uint32_t segment,
                                                             std::uint64_t first_set, const TakeRow& first) {
  std::unique_ptr<SegmentWriter> made(new SegmentWriter(place));
  take::wire::Begin& begin = made->begin_;
  begin.set_version(take::kEvidenceVersion);
  begin.set_take(place.number);
  begin.set_segment(segment);
  begin.set_first_set(first_set);
  begin.set_calibration_id(place.calibration_id.data(), place.calibration_id.size());
  begin.set_rate_numerator(first.rate.numerator);
  begin.set_rate_denominator(first.rate.denominator);
  begin.set_raymaps_a_set(static_cast<std::uint32_t>(place.raymaps_a_set));
  begin.set_second_field_ns(static_cast<std::uint64_t>(std::max<std::int64_t>(0, first.second_field.ns())));
  begin.set_after_error(place.after_error);
  made->tally_ = take::SegmentTally(first.rate);
  if (!first.sets.empty()) made->first_exposure_ = first.sets.front().mid_exposure;
  const auto add = [&](const take::StreamFile& about) {
    made->files_.emplace_back().about = about;
    take::write_stream_file(about, *begin.add_files());
  };
  for (std::size_t head = 0; head < kMaxHeads; ++head) {
    const std::optional<take::Stream>& stream = first.streams[head];
    if (!stream) continue;
    const auto number = static_cast<std::uint32_t>(head);
    add({take::head_file(number, segment), number, *stream, fields_apart(*stream, first, head)});
  }
  if (!place.layout.empty()) {
    take::Stream raymaps;
    raymaps.width = place.raymap_width;
    raymaps.height = place.raymap_height;
    add({take::raymap_file(segment), std::nullopt, raymaps});
  }
  made->evidence_.about.name = take::evidence_file(segment);
  made->next_set_ = first_set;
  NODAL_TRY(made->create_files());
  take::wire::Record record;
  *record.mutable_begin() = begin;
  NODAL_TRY(made->append_record(record));
  for (const take::Manifest::Calibration& calibration : place.calibrations) {
    NODAL_TRY(made->note(calibration));
  }
  if (place.seams) {
    NODAL_TRY(made->note(*place.seams));
  }
  return made;
}

Status SegmentWriter::create_files() {
  const auto create = [&](File& file) -> Status {
    NODAL_TRY_ASSIGN(const auto handle, place_.disk->create(place_.folder + "/" + file.about.name));
    file.handle = handle;
    return {};
  };
  NODAL_TRY(create(evidence_));
  for (std::size_t k = 0; k < files_.size(); ++k) {
    File& file = files_[k];
    NODAL_TRY(create(file));
    file.video.emplace(track_of(file));
    const Bytes head = file.video->head();
    const std::span<const std::uint8_t> piece(head);
    NODAL_TRY(append(file, std::span(&piece, 1)));
    begin_.mutable_files(static_cast<int>(k))->set_head_bytes(head.size());
  }
  return {};
}

/// Before `bytes` are appended. All heads' files grow together, and each in one piece is read faster. It grows by a
/// quarter of what it has, so that a small card is not filled with empty room.
void SegmentWriter::make_room(File& file, std::size_t bytes) {
  constexpr std::uint64_t kMin = 1 << 20, kMax = 32 << 20;
  const std::uint64_t end = file.hashes.bytes() + bytes;
  if (end <= file.room_until) return;
  const std::uint64_t more = bytes + std::clamp(file.hashes.bytes() / 4, kMin, kMax);
  place_.disk->preallocate(file.handle, more);
  file.room_until = file.hashes.bytes() + more;
}

Status SegmentWriter::append(File& file, std::span<const std::span<const std::uint8_t>> pieces) {
  NODAL_TRY(place_.disk->write_pieces(file.handle, pieces));
  for (const auto& piece : pieces) {
    if (file.first.size() < PieceHashes::kPiece) {
      const auto part = piece.first(std::min(piece.size(), PieceHashes::kPiece - file.first.size()));
      file.first.insert(file.first.end(), part.begin(), part.end());
    }
    file.hashes.update(piece);
  }
  return {};
}

Status SegmentWriter::append_record(const take::wire::Record& record) {
  const Bytes bytes = records_.encode(record);
  const std::span<const std::uint8_t> piece(bytes);
  return append(evidence_, std::span(&piece, 1));
}

bool SegmentWriter::fits(const TakeRow& row) const {
  if (!row.sets.empty() && !take::same_rate(tally_.rate(), row.rate)) return false;
  std::size_t found = 0;
  for (const File& file : files_) {
    if (!file.about.head) continue;
    if (row.streams[*file.about.head] != file.about.stream) return false;
    ++found;
  }
  return found == static_cast<std::size_t>(
                      std::ranges::count_if(row.streams, [](const auto& stream) { return stream.has_value(); }));
}

std::uint64_t SegmentWriter::largest_file() const {
  std::uint64_t largest = 0;
  for (const File& file : files_) largest = std::max(largest, file.hashes.bytes());
  return largest;
}

Result<std::span<const std::uint8_t>> SegmentWriter::placeholder_of(File& file) {
  if (file.placeholder.empty()) {
    NODAL_TRY_ASSIGN(auto grey, grey_picture(file.about.stream));
    file.placeholder = std::move(grey);
  }
  return std::span<const std::uint8_t>(file.placeholder);
}

Status SegmentWriter::write(const TakeRow& row) {
  std::vector<take::wire::Record> records;
  records.reserve(row.sets.size() + 1);
  for (const RecordedSet& from : row.sets) {
    if (!first_exposure_) first_exposure_ = from.mid_exposure;
    newest_ = std::max(newest_, from.mid_exposure - *first_exposure_);  // a clock that was set back stands still
    take::wire::Set& set = *records.emplace_back().mutable_set();
    set.set_index(next_set_ + records.size() - 1);
    set.set_number(from.number);
    set.set_mid_exposure_ns(from.mid_exposure.ns());
    set.set_since_start_ns(newest_.ns());
    set.set_genlock(std::string(genlock_state_name(from.sync.state)));
    if (from.sync.trigger) set.set_pulse(*from.sync.trigger);
    set.set_spread_ns(static_cast<std::uint64_t>(from.sync.spread.ns()));
    if (from.sync.begin_spread) set.set_begin_spread_ns(static_cast<std::uint64_t>(from.sync.begin_spread->ns()));
    if (from.sync.drift_ppb) set.set_drift_ppb(*from.sync.drift_ppb);
    set.set_missed(from.missed);
  }
  NODAL_TRY(write_clusters(row, records));
  Bytes bytes;
  for (const take::wire::Record& record : records) {
    const Bytes one = records_.encode(record);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  const std::span<const std::uint8_t> piece(bytes);
  NODAL_TRY(append(evidence_, std::span(&piece, 1)));
  next_set_ += row.sets.size();
  for (const take::wire::Record& record : records) {
    if (record.has_set()) tally_.add(begin_, record.set());
  }
  for (File& file : files_) {
    file.hashes_told = file.hashes.complete().size();
    place_.disk->start_write_out(file.handle);
  }
  return {};
}

Status SegmentWriter::write_clusters(const TakeRow& row, std::vector<take::wire::Record>& records) {
  take::wire::Record last;
  take::wire::Clusters& clusters = *last.mutable_clusters();
  for (std::size_t k = 0; k < files_.size(); ++k) {
    const auto index = static_cast<std::uint32_t>(k);
    NODAL_TRY(files_[k].about.head ? write_head(row, index, records) : write_raymaps(row, index, clusters));
  }
  clusters.set_sets(next_set_ + row.sets.size());
  for (const File& file : files_) {
    clusters.add_end(file.hashes.bytes());
    clusters.add_hashes(bytes_of(std::span(file.hashes.complete()).subspan(file.hashes_told)));
  }
  records.push_back(std::move(last));
  return {};
}

Status SegmentWriter::write_head(const TakeRow& row, std::uint32_t index, std::vector<take::wire::Record>& records) {
  if (row.sets.empty()) return {};
  File& file = files_[index];
  std::vector<take::Block> blocks;
  blocks.reserve(row.sets.size());
  for (std::size_t k = 0; k < row.sets.size(); ++k) {
    const RecordedFrame& frame = row.sets[k].frames[*file.about.head];
    take::Block& block = blocks.emplace_back();
    block.since_start = Duration::nanoseconds(records[k].set().since_start_ns());
    block.frame = frame.bytes;
    if (frame.placeholder == Placeholder::kNone) continue;
    NODAL_TRY_ASSIGN(const auto grey, placeholder_of(file));
    block.frame = grey;
  }
  const take::MatroskaWriter::Cluster cluster = file.video->cluster(blocks);
  std::size_t bytes = 0;
  for (const auto& piece : cluster.pieces) bytes += piece.size();
  make_room(file, bytes);
  NODAL_TRY(append(file, cluster.pieces));
  for (std::size_t k = 0; k < row.sets.size(); ++k) {
    const RecordedFrame& from = row.sets[k].frames[*file.about.head];
    take::wire::Frame& frame = *records[k].mutable_set()->add_frames();
    frame.set_file(index);
    frame.set_at(cluster.frames_at[k]);
    frame.set_bytes(blocks[k].frame.size());
    frame.set_placeholder(std::string(placeholder_name(from.placeholder)));
    if (from.placeholder == Placeholder::kMissing) continue;
    frame.set_offset_ns(from.offset.ns());
    frame.set_exposure_ns(static_cast<std::uint64_t>(from.in_effect.exposure.duration().ns()));
    frame.set_gain_mdb(from.in_effect.gain.mdb());
    frame.set_red_q12(from.in_effect.white_balance.red_q12);
    frame.set_blue_q12(from.in_effect.white_balance.blue_q12);
    frame.set_gamma(static_cast<std::uint32_t>(from.in_effect.gamma.thousandths()));
    frame.set_sequence(from.sequence);
    frame.set_quality(static_cast<std::uint32_t>(from.quality));
  }
  return {};
}

Status SegmentWriter::write_raymaps(const TakeRow& row, std::uint32_t index, take::wire::Clusters& clusters) {
  File& file = files_[index];
  std::vector<take::Block> blocks;
  std::size_t bytes = 0;
  const auto write = [&]() -> Status {
    if (blocks.empty()) return {};
    const take::MatroskaWriter::Cluster cluster = file.video->cluster(blocks);
    NODAL_TRY(append(file, cluster.pieces));
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      take::wire::Raymap& raymap =
          *clusters.mutable_raymaps(clusters.raymaps_size() - static_cast<int>(blocks.size() - k));
      raymap.set_at(cluster.frames_at[k]);
    }
    blocks.clear();
    bytes = 0;
    return {};
  };
  Duration newest = file.newest;
  for (const RecordedRaymap& raymap : row.raymaps) {
    const Duration since = first_exposure_ ? raymap.mid_exposure - *first_exposure_ : Duration();
    newest = std::max(newest, since);
    const take::Block block{newest, raymap.jpeg};
    if (!blocks.empty() && take::MatroskaWriter::cluster_full(bytes, blocks.front().since_start, block)) {
      NODAL_TRY(write());
    }
    blocks.push_back(block);
    bytes += raymap.jpeg.size();
    take::wire::Raymap& stored = *clusters.add_raymaps();
    stored.set_set(raymap.set);
    stored.set_mid_exposure_ns(raymap.mid_exposure.ns());
    stored.set_bytes(raymap.jpeg.size());
  }
  file.newest = newest;
  return write();
}

Status SegmentWriter::mark(const std::string& text, Instant now) {
  take::wire::Record record;
  record.mutable_mark()->set_set(next_set_);
  record.mutable_mark()->set_at_ns(now.ns());
  record.mutable_mark()->set_text(text);
  marks_.push_back({next_set_, text});
  return append_record(record);
}

Status SegmentWriter::note(const take::Manifest::Calibration& calibration) {
  take::wire::Record record;
  record.mutable_calibration()->set_file(calibration.file);
  record.mutable_calibration()->set_id(calibration.id);
  record.mutable_calibration()->set_set(calibration.set);
  return append_record(record);
}

Status SegmentWriter::note(const SeamChange& seams) {
  take::wire::Record record;
  const std::vector<std::uint8_t> own;
  *record.mutable_seams() =
      take::seams_record(seams.first_set, sets::kSeamMapWidth, seams.labels ? *seams.labels : own);
  return append_record(record);
}

Status SegmentWriter::note_durable(Instant now, std::int64_t utc_ns) {
  take::wire::Record record;
  record.mutable_durable()->set_sets(next_set_);
  record.mutable_durable()->set_at_ns(now.ns());
  record.mutable_durable()->set_utc_ns(utc_ns);
  return append_record(record);
}

Result<std::vector<take::Manifest::File>> SegmentWriter::finish(const std::string& reason) {
  std::vector<take::Manifest::File> finished;
  take::wire::Record record;
  take::wire::End& end = *record.mutable_end();
  end.set_sets(next_set_);
  end.set_reason(reason);
  for (File& file : files_) {
    const Bytes cues = file.video->end();
    const std::span<const std::uint8_t> piece(cues);
    NODAL_TRY(append(file, std::span(&piece, 1)));
    const auto sector = file.video->sector();
    NODAL_TRY(place_.disk->overwrite(file.handle, take::MatroskaWriter::kSectorAt, sector));
    if (file.room_until > file.hashes.bytes()) {
      NODAL_TRY(place_.disk->truncate(file.handle, file.hashes.bytes()));
    }
    std::ranges::copy(sector, file.first.begin() + take::MatroskaWriter::kSectorAt);
    std::vector<take::Xxh128> hashes = file.hashes.all();
    hashes.front() = take::xxh128(file.first);
    end.add_length(file.hashes.bytes());
    std::vector<take::Xxh128> stored{hashes.front()};
    const std::size_t from = std::max<std::size_t>(1, file.hashes_told);
    stored.insert(stored.end(), hashes.begin() + static_cast<std::ptrdiff_t>(from), hashes.end());
    end.add_hashes(bytes_of(stored));
    finished.push_back({file.about.name, file.hashes.bytes(), take::digest_of(hashes)});
  }
  NODAL_TRY(append_record(record));
  finished.push_back({evidence_.about.name, evidence_.hashes.bytes(), take::digest_of(evidence_.hashes.all())});
  return finished;
}

}  // namespace nodal::firmware
