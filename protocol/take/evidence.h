// The evidence of one segment of a take: which set each frame belongs to, and where it is in its file.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/take/digest.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.pb.h"

namespace nodal::take {

inline constexpr std::uint32_t kEvidenceVersion = 1;
/// An hour at 120 sets a second with 16 heads would need 1 GiB; segments have a minute.
inline constexpr std::uint64_t kMaxEvidenceBytes = std::uint64_t{64} << 20;
/// A file of each head, and that of the raymaps.
inline constexpr std::size_t kMaxSegmentFiles = 17;
/// Positions and lengths in files. A segment ends when a file has 2 GiB; a row more fits below.
inline constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 33;
/// Sets of a segment: a minute of 1000 a second, and a row more. As many rows, and two raymaps a set.
inline constexpr std::size_t kMaxSegmentSets = 64'000;

/// Turns records into bytes to append.
class EvidenceWriter {
 public:
  /// `next_sequence`: the number of records that the file has already.
  explicit EvidenceWriter(std::uint32_t next_sequence = 0) : sequence_(next_sequence) {}
  std::vector<std::uint8_t> encode(const wire::Record& record);
  std::uint32_t records() const { return sequence_; }

 private:
  std::uint32_t sequence_;
};

/// What the evidence of a segment says, checked: every number is in its range, and every frame inside its file.
struct Segment {
  wire::Begin begin;
  std::vector<wire::Set> sets;  ///< only those whose clusters are in the files; index rises by one
  std::vector<wire::Raymap> raymaps;
  std::vector<wire::Mark> marks;  ///< made printable, at most kMaxMarks, of sets that are there or come next
  std::vector<Manifest::Calibration> calibrations;  ///< those after the take's first, so far
  std::vector<wire::Seams> seams;                   ///< by rising set; labels_of() of seam_map.h
  /// After one cluster of every file.
  struct Row {
    std::uint64_t sets = 0;                ///< number of `sets` up to here
    std::uint64_t raymaps = 0;             ///< number of `raymaps` up to here
    std::vector<std::uint64_t> file_ends;  ///< length of each file, bytes
    std::uint64_t evidence_end = 0;        ///< length of the evidence, bytes
    std::uint32_t records = 0;
  };
  std::vector<Row> rows;
  /// For each file, hashes of its complete pieces before the end. A row has the first file_end / PieceHashes::kPiece of
  /// them.
  std::vector<std::vector<Xxh128>> hashes;
  std::size_t durable_rows = 0;          ///< a Durable record came after these
  std::optional<wire::Durable> durable;  ///< the newest
  std::optional<wire::End> end;
  std::uint64_t good_bytes = 0;  ///< length of the valid prefix of the evidence, bytes

  /// The final hashes of a file's pieces; empty while there is no end.
  std::vector<Xxh128> hashes_of(std::size_t file) const;
  std::uint64_t next_set() const { return begin.first_set() + sets.size(); }
  /// The record of the seams in force at a set, by the rig's number; null: none is recorded.
  const wire::Seams* seams_at(std::uint64_t set) const;
};

/// Reads evidence that arrives in pieces of any size; what is not kept in the Segment is not kept at all.
///
/// Threading: thread-bound. Ownership: none.
/// Errors: of add() and finish(), final: kBadFormat for what is not evidence or contradicts itself, kFutureVersion,
///   kTooLarge over kMaxEvidenceBytes; finish(): kTruncated if not even the first record is whole. They name the file
///   and the record.
class EvidenceReader {
 public:
  explicit EvidenceReader(std::string name);
  ~EvidenceReader();
  EvidenceReader(const EvidenceReader&) = delete;
  EvidenceReader& operator=(const EvidenceReader&) = delete;

  /// Bytes after the newest whole record are torn: they are counted, and nothing else.
  Status add(std::span<const std::uint8_t> bytes);
  /// Bytes in all pieces.
  std::uint64_t bytes() const;
  Result<Segment> finish() &&;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The same for evidence that is in memory, of the file `name`.
Result<Segment> read_evidence(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace nodal::take
