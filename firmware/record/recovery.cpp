#include "firmware/record/recovery.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/record/stored_documents.h"
#include "firmware/record/take_manifest.h"
#include "firmware/storage/durable_file.h"
#include "firmware/storage/file_pieces.h"
#include "protocol/base/try.h"
#include "stitch/media/take/segment_rules.h"

namespace nodal::firmware {
namespace {

using take::PieceHashes;
using Bytes = std::vector<std::uint8_t>;

/// Reads at most a piece of a file. Errors: the disk's; kTruncated if the file is shorter.
Result<Bytes> read_part(hal::DiskPort& disk, const std::string& name, std::uint64_t from, std::uint64_t to) {
  NODAL_TRY_ASSIGN(const auto size, disk.size(name));
  if (to > size || from > to) return fail(Errc::kTruncated, "file '" + name + "': is shorter than its evidence says");
  NODAL_ASSERT(to - from <= PieceHashes::kPiece);
  NODAL_TRY_ASSIGN(const auto handle, disk.open_read(name));
  Bytes bytes(static_cast<std::size_t>(to - from));
  const auto read = disk.read_at(handle, from, bytes);
  disk.close(handle);
  if (!read) return fail(read.error());
  if (*read != bytes.size()) return fail(Errc::kTruncated, "file '" + name + "': is shorter than its evidence says");
  return bytes;
}

struct EvidenceFile {
  Result<take::Segment> segment;
  std::uint64_t bytes = 0;
  PieceHashes hashes;
};

/// Reads the evidence of a segment. Its last bytes may be unreadable after a power cut, and count as missing then; but
/// not more of them than may come between two syncs, because a fault of the disk in what was durable is for people to
/// see. Errors: the disk's.
Result<EvidenceFile> read_evidence_file(const TakePlace& place, const std::string& name) {
  constexpr std::uint64_t kMaxUnreadable = 64 << 10;
  NODAL_TRY_ASSIGN(const auto size, place.disk->size(name));
  take::EvidenceReader reader(name);
  EvidenceFile read{take::Segment(), 0, PieceHashes()};
  const auto add = [&](std::span<const std::uint8_t> bytes) {
    place.progressed();
    read.hashes.update(bytes);
    return reader.add(bytes).has_value();
  };
  FilePieces pieces(*place.disk, name);
  Status readable = for_each_piece(pieces, add);
  if (!readable && readable.error().code == Errc::kIo) {
    while (reader.bytes() < size) {
      const auto part = read_part(*place.disk, name, reader.bytes(),
                                  std::min<std::uint64_t>(size, reader.bytes() + hal::DiskPort::kSector));
      if (!part || !add(*part)) break;
    }
    if (size - reader.bytes() <= kMaxUnreadable) readable = {};
  }
  if (!readable) return fail(readable.error());
  read.bytes = reader.bytes();
  read.segment = std::move(reader).finish();
  return read;
}

std::string path(const TakePlace& place, const std::string& file) { return place.folder + "/" + file; }

std::uint64_t end_of(const take::Segment& found, std::size_t rows, std::size_t file) {
  return rows == 0 ? found.begin.files(static_cast<int>(file)).head_bytes() : found.rows[rows - 1].file_ends[file];
}

/// Errors: the disk's.
Result<bool> are_whole_clusters(const TakePlace& place, const std::string& name, std::uint64_t from, std::uint64_t to) {
  take::ClusterCheck check;
  FilePieces pieces(*place.disk, name, from, to);
  NODAL_TRY(for_each_piece(pieces, [&](std::span<const std::uint8_t> bytes) {
    place.progressed();
    return check.add(bytes);
  }));
  return check.whole() && pieces.at() == to;
}

/// Errors: the disk's. A file that is too short, gone, or cannot be read there, also when it is tried again, is no
/// error: the row is not whole. After a power cut, bytes that were never synced may be unreadable.
Result<bool> row_is_whole(const TakePlace& place, const take::Segment& found, std::size_t row) {
  for (std::size_t file = 0; file < static_cast<std::size_t>(found.begin.files_size()); ++file) {
    const std::string name = path(place, found.begin.files(static_cast<int>(file)).name());
    const auto read = [&] {
      return are_whole_clusters(place, name, end_of(found, row, file), end_of(found, row + 1, file));
    };
    auto whole = read();
    if (!whole && whole.error().code == Errc::kIo) whole = read();
    if (!whole && whole.error().code == Errc::kDeviceGone) return fail(whole.error());
    if (!whole || !*whole) return false;
  }
  return true;
}

/// Whether a finished segment's files have the lengths and, behind what is durable, the bytes that its end states.
Result<bool> end_is_whole(const TakePlace& place, const take::Segment& found, bool only_lengths) {
  for (std::size_t file = 0; file < static_cast<std::size_t>(found.begin.files_size()); ++file) {
    const std::string name = path(place, found.begin.files(static_cast<int>(file)).name());
    const auto size = place.disk->size(name);
    if (!size && size.error().code != Errc::kNotFound) return fail(size.error());
    if (!size || *size != found.end->length(static_cast<int>(file))) return false;
    if (only_lengths) continue;
    const std::vector<take::Xxh128> hashes = found.hashes_of(file);
    const std::uint64_t durable = end_of(found, found.durable_rows, file) / PieceHashes::kPiece;
    for (std::uint64_t piece = 0; piece < hashes.size(); ++piece) {
      if (piece != 0 && piece < durable) continue;
      const std::uint64_t from = piece * PieceHashes::kPiece;
      place.progressed();
      const auto bytes = read_part(*place.disk, name, from, std::min(*size, from + PieceHashes::kPiece));
      if (!bytes && bytes.error().code == Errc::kDeviceGone) return fail(bytes.error());
      if (!bytes) return false;
      if (take::xxh128(*bytes) != hashes[static_cast<std::size_t>(piece)]) return false;
    }
  }
  return true;
}

Duration length_of(const take::Segment& found, std::uint64_t sets) {
  return Duration::nanoseconds(sets == 0 ? 0 : found.sets[static_cast<std::size_t>(sets - 1)].since_start_ns());
}

}  // namespace

Status remove_segment(hal::DiskPort& disk, const std::string& folder, std::uint32_t segment) {
  const auto remove = [&](const std::string& name) -> Status {
    const Status removed = disk.remove(folder + "/" + name);
    return !removed && removed.error().code == Errc::kNotFound ? Status() : removed;
  };
  NODAL_TRY(remove(take::evidence_file(segment)));
  NODAL_TRY(disk.sync_folder(folder));
  std::vector<std::string> names{take::raymap_file(segment)};
  for (std::uint32_t head = 0; head < kMaxHeads; ++head) names.push_back(take::head_file(head, segment));
  for (const std::string& name : names) {
    NODAL_TRY(remove(name));
  }
  return {};
}

Status SegmentWriter::reopen(File& file, std::uint64_t length, std::vector<take::Xxh128> hashes) {
  const std::string name = path(place_, file.about.name);
  const std::uint64_t hashed = hashes.size() * PieceHashes::kPiece;
  file.hashes_told = hashes.size();
  file.hashes = PieceHashes(std::move(hashes));
  NODAL_TRY_ASSIGN(const auto first, read_part(*place_.disk, name, 0, std::min(length, PieceHashes::kPiece)));
  file.first = first;
  for (std::uint64_t from = hashed; from < length; from += PieceHashes::kPiece) {
    NODAL_TRY_ASSIGN(const auto bytes,
                     read_part(*place_.disk, name, from, std::min(length, from + PieceHashes::kPiece)));
    file.hashes.update(bytes);
  }
  NODAL_TRY_ASSIGN(const auto handle, place_.disk->open_append(name));
  file.handle = handle;
  return place_.disk->truncate(file.handle, length);
}

Result<std::unique_ptr<SegmentWriter>> SegmentWriter::reopen(const TakePlace& place, const take::Segment& found,
                                                             std::size_t rows) {
  NODAL_ASSERT(rows >= 1 && rows <= found.rows.size());
  const take::Segment::Row& last = found.rows[rows - 1];
  std::unique_ptr<SegmentWriter> made(new SegmentWriter(place));
  made->begin_ = found.begin;
  made->next_set_ = found.begin.first_set() + last.sets;
  made->newest_ = length_of(found, last.sets);
  const std::int64_t first_ns = found.sets.empty() ? 0 : found.sets.front().mid_exposure_ns();
  made->first_exposure_ = Instant::from_ns(first_ns);
  made->records_ = take::EvidenceWriter(last.records);
  made->tally_ = take::SegmentTally(take::rate_of(found.begin, place.rate));
  for (std::size_t k = 0; k < last.sets; ++k) made->tally_.add(found.begin, found.sets[k]);
  for (const take::wire::Mark& mark : found.marks) {
    if (mark.set() <= made->next_set_) made->marks_.push_back({mark.set(), mark.text()});
  }
  for (std::size_t k = 0; k < static_cast<std::size_t>(found.begin.files_size()); ++k) {
    const take::wire::File& stored = found.begin.files(static_cast<int>(k));
    File& file = made->files_.emplace_back();
    file.about = take::stream_file(stored);
    std::vector<take::Xxh128> hashes = found.hashes[k];
    hashes.resize(static_cast<std::size_t>(last.file_ends[k] / PieceHashes::kPiece));
    NODAL_TRY(made->reopen(file, last.file_ends[k], std::move(hashes)));
    file.video.emplace(made->track_of(file), stored.head_bytes());
    std::size_t sets = 0, raymaps = 0;
    Duration newest;
    for (std::size_t row = 0; row < rows; ++row) {
      const take::Segment::Row& each = found.rows[row];
      const auto raymap_time = [&](std::size_t i) {
        return Duration::nanoseconds(found.raymaps[i].mid_exposure_ns()) - Duration::nanoseconds(first_ns);
      };
      Duration begin = newest;
      if (stored.has_head() && each.sets > sets) {
        begin = Duration::nanoseconds(found.sets[sets].since_start_ns());
        newest = length_of(found, each.sets);
      } else if (!stored.has_head() && each.raymaps > raymaps) {
        begin = std::max(newest, raymap_time(raymaps));
        newest = std::max(begin, raymap_time(static_cast<std::size_t>(each.raymaps) - 1));
      }
      if (each.file_ends[k] > file.video->size()) file.video->note_cluster(begin, newest, each.file_ends[k]);
      sets = static_cast<std::size_t>(each.sets);
      raymaps = static_cast<std::size_t>(each.raymaps);
    }
  }
  made->evidence_.about.name = take::evidence_file(found.begin.segment());
  NODAL_TRY(made->reopen(made->evidence_, last.evidence_end, {}));
  return made;
}

Result<std::optional<FinishedSegment>> recover_segment(const TakePlace& place, std::uint32_t segment, Trust trust,
                                                       const std::string& reason, const AcceptSegment& accept) {
  const std::string name = path(place, take::evidence_file(segment));
  NODAL_TRY_ASSIGN(const auto evidence, read_evidence_file(place, name));
  const Result<take::Segment>& found = evidence.segment;
  if (!found && found.error().code != Errc::kTruncated) return fail(found.error());
  std::size_t rows = 0;
  if (found) {
    if (const Status good = accept ? accept(*found) : Status(); !good) return fail(good.error().in(name));
    if (found->end && found->good_bytes == evidence.bytes && trust != Trust::kDurable) {
      NODAL_TRY_ASSIGN(const auto whole, end_is_whole(place, *found, trust == Trust::kAll));
      if (whole) {
        FinishedSegment done;
        done.number = segment;
        done.first_set = found->begin.first_set();
        done.calibrations = found->calibrations;
        done.sets = found->sets.size();
        done.length = length_of(*found, done.sets);
        done.tally = take::tally_of(*found, place.rate);
        for (const take::wire::Mark& mark : found->marks) done.marks.push_back({mark.set(), mark.text()});
        for (std::size_t file = 0; file < static_cast<std::size_t>(found->begin.files_size()); ++file) {
          done.files.push_back({found->begin.files(static_cast<int>(file)).name(),
                                found->end->length(static_cast<int>(file)), take::digest_of(found->hashes_of(file))});
        }
        done.files.push_back({take::evidence_file(segment), evidence.bytes, take::digest_of(evidence.hashes.all())});
        return done;
      }
    }
    rows = trust == Trust::kAll ? found->rows.size() : found->durable_rows;
    while (trust == Trust::kChecked && rows < found->rows.size()) {
      NODAL_TRY_ASSIGN(const auto whole, row_is_whole(place, *found, rows));
      if (!whole) break;
      ++rows;
    }
  }
  if (rows == 0) {
    NODAL_TRY(remove_segment(*place.disk, place.folder, segment));
    return std::optional<FinishedSegment>();
  }
  FinishedSegment done;
  done.number = segment;
  done.first_set = found->begin.first_set();
  done.calibrations = found->calibrations;
  for (std::size_t file = 0; file < static_cast<std::size_t>(found->begin.files_size()); ++file) {
    const auto size = place.disk->size(path(place, found->begin.files(static_cast<int>(file)).name()));
    if (size) done.cut_bytes += *size - std::min(*size, end_of(*found, rows, file));
  }
  NODAL_TRY_ASSIGN(auto writer, SegmentWriter::reopen(place, *found, rows));
  NODAL_TRY_ASSIGN(auto files, writer->finish(reason));
  done.files = std::move(files);
  done.sets = writer->sets();
  done.length = writer->length();
  done.marks = writer->marks();
  done.tally = writer->tally();
  return done;
}

Result<bool> nothing_recorded(hal::DiskPort& disk, const std::string& folder) {
  const std::string name = folder + "/" + take::kTakeFile;
  const auto text = disk.read(name, take::kMaxTakeJsonBytes);
  if (text && take::parse_take_json({reinterpret_cast<const char*>(text->data()), text->size()}, name)) return false;
  if (!text && text.error().code != Errc::kNotFound) return fail(text.error());
  NODAL_TRY_ASSIGN(const auto entries, disk.list(folder));
  return std::ranges::all_of(entries, [](std::string_view file) {
    if (file.ends_with(kTemporarySuffix)) file.remove_suffix(kTemporarySuffix.size());
    return file == take::kTakeFile || file == take::kCalibrationFile || file == take::kRigFile ||
           file == take::kRecoveringFile;
  });
}

namespace {

/// Whether a segment that cannot be finished for this reason is left out. Not for a disk that fails: it may work again.
bool left_out_for(Errc why) {
  return why == Errc::kNotFound || why == Errc::kBadFormat || why == Errc::kBadValue || why == Errc::kTruncated ||
         why == Errc::kTooLarge;
}

TakePlace place_of(hal::DiskPort& disk, const std::string& folder, const take::TakeDocument& about) {
  TakePlace place;
  place.disk = &disk;
  place.folder = folder;
  place.number = about.number;
  place.rate = about.rate;
  place.raymaps_a_set = about.raymaps_a_set;
  place.utc_offset_ns = about.utc_offset_ns();
  place.layout = about.layout;
  place.software = about.software;
  return place;
}

/// The segments that a take's folder has evidence of, rising.
Result<std::vector<std::uint32_t>> segments_in(hal::DiskPort& disk, const std::string& folder) {
  NODAL_TRY_ASSIGN(const auto entries, disk.list(folder));
  return take::segments_among(entries);
}

}  // namespace

Result<take::Manifest> recover_take(hal::DiskPort& disk, const std::string& folder,
                                    const std::function<void()>& progress) {
  NODAL_TRY_ASSIGN(const auto about, stored_take_json(disk, folder));
  TakePlace place = place_of(disk, folder, about);
  place.progress = progress;
  NODAL_TRY_ASSIGN(const auto segments, segments_in(disk, folder));
  ManifestSum sum(about.number, "recovered", about.heads.size());
  std::string& ended = sum.manifest().ended;
  std::uint64_t recorded = 0;
  for (std::size_t k = 0; k < segments.size(); ++k) {
    const std::uint32_t segment = segments[k];
    const Trust trust = k + 1 < segments.size() ? Trust::kAll : Trust::kChecked;
    const media::SetsBefore before{sum.sets(), recorded - sum.sets()};
    auto done = recover_segment(place, segment, trust, "recovered", [&](const take::Segment& found) {
      return media::check_segment(found, segment, about, before);
    });
    const bool readable = done.has_value();
    if (!readable && !left_out_for(done.error().code)) return fail(done.error());
    // exFAT can lose the entry of a durable file; and what contradicts itself is not worth the pictures of the other
    // segments.
    if (!readable || (*done && !sum.has_room(**done))) {
      constexpr std::size_t kLongest = 200;  // bytes; a manifest's text has at most 256
      if (ended.size() < kLongest) ended += fmt::format(", without segment {}", segment);
      continue;
    }
    if (!*done) continue;
    recorded = (*done)->first_set + (*done)->sets;
    sum.add(**done);
  }
  if (sum.manifest().marks.size() > take::kMaxMarks)
    ended += fmt::format(", without marks after the first {}", take::kMaxMarks);
  NODAL_TRY_ASSIGN(auto flight, recover_flight(disk, folder));
  take::Manifest manifest = sum.finish(recorded);
  if (flight) manifest.files.push_back(std::move(*flight));
  return write_manifest(disk, folder, std::move(manifest));
}

}  // namespace nodal::firmware
