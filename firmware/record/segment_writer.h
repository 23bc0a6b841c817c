// Writes the files of one segment of a take.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/picture/seam_log.h"
#include "firmware/record/take_row.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/take/digest.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "protocol/take/matroska_writer.h"
#include "protocol/take/stream.h"
#include "protocol/take/tally.h"

namespace nodal::firmware {

/// What all segments of a take have in common.
struct TakePlace {
  hal::DiskPort* disk = nullptr;
  std::string folder;  ///< the take's folder, relative to the disk's root: "000042"
  std::uint64_t number = 0;
  FrameRate rate;                               ///< the rate in take.json, which was in force when the take began
  int raymaps_a_set = 1;                        ///< 2: one of each field
  std::optional<std::int64_t> utc_offset_ns{};  ///< UTC minus the rig's monotonic clock
  /// The sets that are missing before the next segment were written, and an error of the disk lost them.
  bool after_error = false;
  /// Layout of the raymaps; empty: they are not recorded.
  std::string layout;
  int raymap_width = 0;
  int raymap_height = 0;
  std::string software;
  std::string calibration_json;  ///< attached to every file; empty: none
  std::vector<std::uint8_t> calibration_id;
  /// Those after the take's first, in order. Every segment's evidence has them, because earlier segments may be
  /// deleted.
  std::vector<take::Manifest::Calibration> calibrations;
  /// Placed seams in force for the newest written set. Every segment's evidence begins with them, for the same reason.
  std::optional<SeamChange> seams{};
  /// Called while the take is recovered, for every piece that was read; may be empty.
  std::function<void()> progress{};
  void progressed() const {
    if (progress) progress();
  }
};

/// One file for each head that has a stream, one for raymaps, and the evidence. A row appends one cluster to each file
/// that has new frames, then its records.
///
/// Threading: thread-bound to the disk's stage; every call blocks on the disk.
/// Ownership: closes its files.
/// Errors: the disk's. After one, nothing more can be written; recover_segment() cuts off what is incomplete.
class SegmentWriter {
 public:
  /// Creates the files for the row's streams; it does not write the row.
  static Result<std::unique_ptr<SegmentWriter>> create(const TakePlace& place, std::uint32_t segment,
                                                       std::uint64_t first_set, const TakeRow& first);
  /// Opens a segment that was not finished, and cuts its files to its first `rows` rows, at least one.
  static Result<std::unique_ptr<SegmentWriter>> reopen(const TakePlace& place, const take::Segment& found,
                                                       std::size_t rows);
  ~SegmentWriter();
  SegmentWriter(const SegmentWriter&) = delete;
  SegmentWriter& operator=(const SegmentWriter&) = delete;

  Status write(const TakeRow& row);
  Status mark(const std::string& text, Instant now);
  Status note(const take::Manifest::Calibration& calibration);
  Status note(const SeamChange& seams);
  /// Call after DiskPort::sync_all(): what is written is durable.
  Status note_durable(Instant now, std::int64_t utc_ns);
  /// Writes the index of every file and ends the evidence. Returns the segment's files for the manifest.
  Result<std::vector<take::Manifest::File>> finish(const std::string& reason);

  /// Whether the segment's files fit this row: the same rate, the same heads with the same formats.
  bool fits(const TakeRow& row) const;
  std::uint64_t next_set() const { return next_set_; }
  std::uint64_t sets() const { return next_set_ - begin_.first_set(); }
  Duration length() const { return newest_; }
  const std::vector<take::Manifest::Mark>& marks() const { return marks_; }
  std::uint64_t largest_file() const;
  std::uint64_t evidence_bytes() const { return evidence_.hashes.bytes(); }
  const take::SegmentTally& tally() const { return tally_; }

 private:
  struct File {
    take::StreamFile about;
    hal::FileHandle handle = 0;
    std::optional<take::MatroskaWriter> video;
    take::PieceHashes hashes;
    std::size_t hashes_told = 0;            ///< those in the evidence
    std::uint64_t room_until = 0;           ///< bytes that the file was given room for
    std::vector<std::uint8_t> first;        ///< the first piece, whose sector is written again at the end
    Duration newest;                        ///< time of the newest raymap
    std::vector<std::uint8_t> placeholder;  ///< a grey picture; empty until it is needed
  };

  explicit SegmentWriter(const TakePlace& place) : place_(place) {}
  take::VideoTrack track_of(const File& file) const;
  void make_room(File& file, std::size_t bytes);
  Status append(File& file, std::span<const std::span<const std::uint8_t>> pieces);
  Status append_record(const take::wire::Record& record);
  Status create_files();
  Result<std::span<const std::uint8_t>> placeholder_of(File& file);
  Status write_clusters(const TakeRow& row, std::vector<take::wire::Record>& records);
  Status write_head(const TakeRow& row, std::uint32_t index, std::vector<take::wire::Record>& records);
  Status write_raymaps(const TakeRow& row, std::uint32_t index, take::wire::Clusters& clusters);
  Status reopen(File& file, std::uint64_t length, std::vector<take::Xxh128> hashes);

  TakePlace place_;
  take::wire::Begin begin_;
  std::vector<File> files_;
  File evidence_;  ///< without video
  take::EvidenceWriter records_;
  std::uint64_t next_set_ = 0;
  std::optional<Instant> first_exposure_;
  Duration newest_;  ///< time in the files
  std::vector<take::Manifest::Mark> marks_;
  take::SegmentTally tally_;
};

}  // namespace nodal::firmware
