#include "protocol/take/evidence.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/framing.h"
#include "protocol/silence_protobuf.h"
#include "protocol/take/limits.h"
#include "protocol/take/seam_map.h"

namespace nodal::take {
namespace {

/// Reads one segment record by record.
class Reader {
 public:
  explicit Reader(Segment& into) : segment_(into) {}

  Status add(const wire::Record& record, std::uint64_t end) {
    ++records_;
    if (segment_.end) return fail(Errc::kBadFormat, "there is a record after the last one");
    if ((records_ == 1) != record.has_begin()) return fail(Errc::kBadFormat, "it does not start with one begin record");
    if (record.has_begin()) return begin(record.begin());
    if (record.has_set()) return set(record.set());
    if (record.has_clusters()) return clusters(record.clusters(), end);
    if (record.has_mark()) mark(record.mark());
    if (record.has_calibration()) return calibration(record.calibration());
    if (record.has_seams()) return seams(record.seams());
    if (record.has_durable()) {
      segment_.durable = record.durable();
      segment_.durable_rows = segment_.rows.size();
    }
    if (record.has_end()) return ended(record.end());
    return {};
  }

 private:
  std::size_t files() const { return static_cast<std::size_t>(segment_.begin.files_size()); }

  Status begin(const wire::Begin& begin) {
    if (begin.version() > kEvidenceVersion) {
      return fail(Errc::kFutureVersion,
                  fmt::format("version {} of the evidence is newer than this program", begin.version()));
    }
    const auto files = static_cast<std::size_t>(begin.files_size());
    if (begin.version() == 0 || files == 0 || files > kMaxSegmentFiles) {
      return fail(Errc::kBadFormat, fmt::format("version {} with {} files", begin.version(), files));
    }
    if (begin.first_set() > kMaxSets || begin.segment() > kMaxSegments) {
      return fail(Errc::kBadFormat, fmt::format("segment {} from set {}", begin.segment(), begin.first_set()));
    }
    std::uint32_t heads = 0;
    bool raymaps = false;
    for (const wire::File& file : begin.files()) {
      const bool again = file.has_head() ? file.head() >= kMaxHeads || (heads >> file.head() & 1) != 0 : raymaps;
      const std::string name = file.has_head() ? head_file(file.head(), begin.segment()) : raymap_file(begin.segment());
      if (again || file.name() != name || !pixel_format_named(file.format()) || file.width() == 0 ||
          file.height() == 0 || file.width() > kMaxTakePictureSide || file.height() > kMaxTakePictureSide ||
          file.head_bytes() > kMaxFileBytes) {
        return fail(Errc::kBadFormat,
                    fmt::format("file '{}' ({} {}x{})", file.name(), file.format(), file.width(), file.height()));
      }
      if (file.has_head()) heads |= 1U << file.head();
      raymaps |= !file.has_head();
      open_end_.push_back(file.head_bytes());
    }
    segment_.begin = begin;
    segment_.hashes.resize(files);
    return {};
  }

  /// The frame is behind what its file has already.
  Status take_bytes(std::size_t file, std::uint64_t at, std::uint64_t bytes) {
    if (at < open_end_[file] || at > kMaxFileBytes || bytes > kMaxFileBytes) {
      return fail(Errc::kBadFormat, fmt::format("a frame of {} at byte {} with {} bytes",
                                                segment_.begin.files(static_cast<int>(file)).name(), at, bytes));
    }
    open_end_[file] = at + bytes;
    return {};
  }

  Status set(const wire::Set& set) {
    const std::uint64_t expected = segment_.begin.first_set() + segment_.sets.size() + open_.size();
    if (segment_.sets.size() + open_.size() == kMaxSegmentSets)
      return fail(Errc::kTooLarge, fmt::format("more than {} sets", kMaxSegmentSets));
    if (set.index() != expected || expected >= kMaxSets)
      return fail(Errc::kBadFormat, fmt::format("set {} where {} comes next", set.index(), expected));
    if (set.since_start_ns() < newest_ns_ || set.since_start_ns() > kMaxTimeNs || set.mid_exposure_ns() < -kMaxTimeNs ||
        set.mid_exposure_ns() > kMaxTimeNs) {
      return fail(Errc::kBadFormat, fmt::format("set {} is {} ns after the first, at {} ns", set.index(),
                                                set.since_start_ns(), set.mid_exposure_ns()));
    }
    newest_ns_ = set.since_start_ns();
    std::uint32_t seen = 0;
    for (const wire::Frame& frame : set.frames()) {
      if (frame.file() >= files() || (seen >> frame.file() & 1) != 0 ||
          !segment_.begin.files(static_cast<int>(frame.file())).has_head()) {
        return fail(Errc::kBadFormat, fmt::format("set {} has a frame in file {}", set.index(), frame.file()));
      }
      seen |= 1U << frame.file();
      NODAL_TRY(take_bytes(frame.file(), frame.at(), frame.bytes()));
    }
    for (std::size_t file = 0; file < files(); ++file) {
      if (segment_.begin.files(static_cast<int>(file)).has_head() && (seen >> file & 1) == 0) {
        return fail(Errc::kBadFormat, fmt::format("set {} has no frame in {}", set.index(),
                                                  segment_.begin.files(static_cast<int>(file)).name()));
      }
    }
    open_.push_back(set);
    return {};
  }

  Status clusters(const wire::Clusters& clusters, std::uint64_t end) {
    if (static_cast<std::size_t>(clusters.end_size()) != files() ||
        static_cast<std::size_t>(clusters.hashes_size()) != files() ||
        clusters.sets() != segment_.begin.first_set() + segment_.sets.size() + open_.size()) {
      return fail(Errc::kBadFormat,
                  fmt::format("clusters up to set {} of {} files", clusters.sets(), clusters.end_size()));
    }
    if (segment_.rows.size() == kMaxSegmentSets ||
        static_cast<std::size_t>(clusters.raymaps_size()) > 2 * kMaxSegmentSets - segment_.raymaps.size()) {
      return fail(Errc::kTooLarge,
                  fmt::format("more than {} clusters or {} raymaps", kMaxSegmentSets, 2 * kMaxSegmentSets));
    }
    std::optional<std::size_t> raymap_file;
    for (std::size_t file = 0; file < files(); ++file) {
      if (!segment_.begin.files(static_cast<int>(file)).has_head()) raymap_file = file;
    }
    for (const wire::Raymap& raymap : clusters.raymaps()) {
      if (!raymap_file) return fail(Errc::kBadFormat, "a raymap without a file of raymaps");
      NODAL_TRY(take_bytes(*raymap_file, raymap.at(), raymap.bytes()));
      if (raymap.mid_exposure_ns() < -kMaxTimeNs || raymap.mid_exposure_ns() > kMaxTimeNs)
        return fail(Errc::kBadFormat, fmt::format("a raymap at {} ns", raymap.mid_exposure_ns()));
      segment_.raymaps.push_back(raymap);
    }
    Segment::Row row;
    for (std::size_t file = 0; file < files(); ++file) {
      const std::uint64_t length = clusters.end(static_cast<int>(file));
      if (length < open_end_[file] || length > kMaxFileBytes) {
        return fail(Errc::kBadFormat,
                    fmt::format("{} ends at byte {}", segment_.begin.files(static_cast<int>(file)).name(), length));
      }
      open_end_[file] = length;
      NODAL_TRY(append_hashes(clusters.hashes(static_cast<int>(file)), segment_.hashes[file]));
      if (segment_.hashes[file].size() != length / PieceHashes::kPiece)
        return fail(Errc::kBadFormat, "hashes are missing");
    }
    row.file_ends = open_end_;
    std::ranges::move(open_, std::back_inserter(segment_.sets));
    open_.clear();
    row.sets = segment_.sets.size();
    row.raymaps = segment_.raymaps.size();
    row.evidence_end = end;
    row.records = records_;
    segment_.rows.push_back(std::move(row));
    return {};
  }

  /// A mark is no reason to refuse the pictures, so a strange one is read as the nearest that there may be.
  void mark(const wire::Mark& stored) {
    if (segment_.marks.size() == kMaxMarks) return;
    wire::Mark& mark = segment_.marks.emplace_back(stored);
    mark.set_set(std::clamp(stored.set(), segment_.begin.first_set(), segment_.next_set() + open_.size()));
    mark.set_text(printable(stored.text(), kMaxMarkBytes));
  }

  Status calibration(const wire::Calibration& stored) {
    Manifest::Calibration calibration{stored.file(), stored.id(), stored.set()};
    NODAL_TRY(check_next(calibration, segment_.calibrations));
    segment_.calibrations.push_back(std::move(calibration));
    return {};
  }

  Status seams(const wire::Seams& seams) {
    if (segment_.seams.size() == kMaxSegmentSets)
      return fail(Errc::kTooLarge, fmt::format("more than {} changes of seams", kMaxSegmentSets));
    if (!segment_.seams.empty() && seams.set() <= segment_.seams.back().set()) {
      return fail(Errc::kBadFormat, fmt::format("seams from set {} on come after those from set {} on", seams.set(),
                                                segment_.seams.back().set()));
    }
    NODAL_TRY(check_seams(seams));
    segment_.seams.push_back(seams);
    return {};
  }

  static Status append_hashes(const std::string& bytes, std::vector<Xxh128>& to) {
    if (bytes.size() % sizeof(Xxh128) != 0) return fail(Errc::kBadFormat, "a hash is incomplete");
    for (std::size_t k = 0; k < bytes.size(); k += sizeof(Xxh128)) {
      Xxh128 hash{};
      std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(k), hash.size(), hash.begin());
      to.push_back(hash);
    }
    return {};
  }

  Status ended(const wire::End& end) {
    if (static_cast<std::size_t>(end.length_size()) != files() ||
        static_cast<std::size_t>(end.hashes_size()) != files() || !open_.empty() || end.sets() != segment_.next_set()) {
      return fail(Errc::kBadFormat, fmt::format("an end at set {} with {} files", end.sets(), end.length_size()));
    }
    segment_.end = end;
    for (std::size_t file = 0; file < files(); ++file) {
      const std::uint64_t length = end.length(static_cast<int>(file));
      const std::uint64_t pieces = (length + PieceHashes::kPiece - 1) / PieceHashes::kPiece;
      if (length > kMaxFileBytes || length < open_end_[file] ||
          end.hashes(static_cast<int>(file)).size() % sizeof(Xxh128) != 0 ||
          segment_.hashes_of(file).size() != pieces) {
        return fail(Errc::kBadFormat,
                    fmt::format("{} ends at byte {}", segment_.begin.files(static_cast<int>(file)).name(), length));
      }
    }
    return {};
  }

  Segment& segment_;
  std::uint32_t records_ = 0;
  std::int64_t newest_ns_ = 0;
  std::vector<wire::Set> open_;          ///< since the last clusters
  std::vector<std::uint64_t> open_end_;  ///< by file, the byte after the newest frame
};

}  // namespace

std::vector<std::uint8_t> EvidenceWriter::encode(const wire::Record& record) {
  const std::string payload = record.SerializeAsString();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto head = encode_frame_header({FrameType::kTakeRecord, 0, 0, sequence_++}, bytes);
  std::vector<std::uint8_t> out(head.size() + bytes.size());
  std::ranges::copy(bytes, std::ranges::copy(head, out.begin()).out);
  return out;
}

std::vector<Xxh128> Segment::hashes_of(std::size_t file) const {
  if (!end) return {};
  std::vector<Xxh128> all = hashes[file];
  const std::string& rest = end->hashes(static_cast<int>(file));
  for (std::size_t k = 0; k + sizeof(Xxh128) <= rest.size(); k += sizeof(Xxh128)) {
    Xxh128 hash{};
    std::copy_n(rest.begin() + static_cast<std::ptrdiff_t>(k), hash.size(), hash.begin());
    if (k == 0 && !all.empty()) {
      all.front() = hash;  // the first piece was rewritten at the end
    } else {
      all.push_back(hash);
    }
  }
  return all;
}

struct EvidenceReader::State {
  explicit State(std::string of) : name(std::move(of)) {}

  const std::string name;
  Segment segment;
  Reader reader{segment};
  FrameDecoder decoder;
  std::uint64_t bytes = 0;
  bool torn = false;
  Status status;
};

EvidenceReader::EvidenceReader(std::string name) : state_(std::make_unique<State>(std::move(name))) {
  silence_protobuf();
}
EvidenceReader::~EvidenceReader() = default;

std::uint64_t EvidenceReader::bytes() const { return state_->bytes; }

Status EvidenceReader::add(std::span<const std::uint8_t> bytes) {
  State& at = *state_;
  const std::uint64_t before = at.bytes, size = bytes.size();
  at.bytes += size;
  if (at.status && at.bytes > kMaxEvidenceBytes) {
    at.status = fail(Errc::kTooLarge, fmt::format("{}: {} bytes; at most {}", at.name, at.bytes, kMaxEvidenceBytes));
  }
  while (at.status && !at.torn && !bytes.empty()) {
    const auto frame = at.decoder.next(bytes);
    at.torn = !frame;
    if (!frame || !*frame) break;
    wire::Record record;
    if ((*frame)->header.type != FrameType::kTakeRecord || (*frame)->header.stream != 0 ||
        !record.ParseFromArray((*frame)->payload.data(), static_cast<int>((*frame)->payload.size()))) {
      at.status =
          fail(Errc::kBadFormat, fmt::format("{}: record {} is not one of evidence", at.name, at.decoder.frames() - 1));
      break;
    }
    const std::uint64_t end = before + size - bytes.size();
    if (const Status good = at.reader.add(record, end); !good) {
      at.status = fail(good.error().in(fmt::format("{}: record {}", at.name, at.decoder.frames() - 1)));
      break;
    }
    at.segment.good_bytes = end;
  }
  return at.status;
}

Result<Segment> EvidenceReader::finish() && {
  if (!state_->status) return fail(state_->status.error());
  if (state_->segment.good_bytes == 0)
    return fail(Errc::kTruncated, fmt::format("{}: not even its first record is whole", state_->name));
  return std::move(state_->segment);
}

const wire::Seams* Segment::seams_at(std::uint64_t set) const {
  const auto next = std::ranges::upper_bound(seams, set, {}, &wire::Seams::set);
  return next == seams.begin() ? nullptr : &*std::prev(next);
}

Result<Segment> read_evidence(std::span<const std::uint8_t> bytes, const std::string& name) {
  EvidenceReader reader(name);
  NODAL_TRY(reader.add(bytes));
  return std::move(reader).finish();
}

}  // namespace nodal::take
