// Writes one take.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "firmware/record/recovery.h"
#include "firmware/record/segment_writer.h"
#include "firmware/record/take_manifest.h"
#include "firmware/record/take_row.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/take/documents.h"

namespace nodal::firmware {

/// The rig's own count of a take's sets.
struct SetCounts {
  std::uint64_t slow = 0;   ///< not given to the writer, because the disk or the board was too slow
  std::uint64_t given = 0;  ///< to the writer; those that are not in the take were lost by errors of the disk
};

/// Cuts the take into segments: after kLongestSegment or kLargestFile, when a head's format changes, and when a sync
/// fails. A failed sync is never repeated, because the kernel forgets which bytes it could not write: the segment is
/// cut to what was durable before, and the next row starts another one.
///
/// Threading: thread-bound to the disk's stage; every call blocks on the disk.
/// Ownership: the disk outlives it.
/// Errors: the disk's. After one in write(), mark() or end() call end() to save what can be saved.
class TakeWriter {
 public:
  struct Documents {
    take::TakeDocument about;
    std::optional<Sha256> calibration;  ///< hash of the calibration in force; empty: none
    std::string calibration_json;
    std::string rig_toml;
    int raymap_width = 0;
    int raymap_height = 0;
  };

  /// Makes the folder and writes its documents, durably. Errors: kExists if there is anything of that name, which then
  /// stays as it is; after another error nothing of the folder is left, if the disk still allows it.
  static Result<std::unique_ptr<TakeWriter>> begin(hal::DiskPort& disk, Documents documents);

  Status write(const TakeRow& row);
  /// Makes everything written durable. Errors: that of the sync; the take goes on, if the segment can be cut.
  Status sync(Instant now, std::int64_t utc_ns);
  Status mark(const std::string& text, Instant now);
  /// Stores a calibration durably, with the set from which on it is in force. Does nothing if it already is. After
  /// take::kMaxCalibrations notes that this one is not stored; the take continues without this and later ones.
  Status use_calibration(const TakeCalibration& calibration);
  /// Takes seams that were placed, before the first set that is blended with them is written. At most kMaxSeamsAhead
  /// may wait for their sets.
  void use_seams(SeamChange seams) { seams_ahead_.push_back(std::move(seams)); }
  bool takes_seams() const { return seams_ahead_.size() < kMaxSeamsAhead; }
  /// Appends to the flight record, and makes its file first. After an error the take continues without a flight record.
  void write_flight(std::span<const std::uint8_t> record);
  /// Finishes all files and writes the manifest. If the disk has errors this may fail; then there is no manifest, and
  /// the take is recovered at the next start.
  Result<take::Manifest> end(const std::string& reason, SetCounts counts = {});
  /// Deletes the oldest finished segment that is not near a mark, and returns its bytes; nothing if there is none.
  Result<std::optional<std::uint64_t>> delete_oldest();

  std::uint64_t number() const { return place_.number; }
  /// Bytes of the segments that delete_oldest() would delete one after the other.
  std::uint64_t deletable_bytes() const;
  /// Number of recorded sets, including deleted ones.
  std::uint64_t sets() const { return finished_sets_ + (segment_ ? segment_->sets() : 0); }
  bool synced() const { return !unsynced_; }
  /// A calibration was not stored, so later sets cannot be rendered as they were blended.
  bool left_out_calibrations() const { return !place_.calibrations.empty() && !place_.calibrations.back().stored(); }

  static constexpr Duration kLongestSegment = Duration::seconds(60);
  static constexpr std::size_t kMaxSeamsAhead = 64;
  static constexpr std::uint64_t kLargestFile = std::uint64_t{2} << 30;
  /// Half of the size that a reader accepts.
  static constexpr std::uint64_t kLargestEvidence = take::kMaxEvidenceBytes / 2;

 private:
  Status note_seams(std::uint64_t set);
  Status begin_segment(const TakeRow& row);
  Status finish_segment(const std::string& reason);
  Status cut_segment(const std::string& reason);
  FrameRate fastest() const;
  void write_thumbnail(const TakeRow& row);
  void close_flight();
  Result<std::optional<take::Manifest::File>> finish_flight();
  void add(FinishedSegment done);
  bool may_be_deleted(const FinishedSegment& segment, const std::vector<take::Manifest::Mark>& marks) const;
  std::vector<take::Manifest::Mark> marks() const;

  TakePlace place_;
  std::size_t heads_ = 0;
  std::unique_ptr<SegmentWriter> segment_;
  std::optional<Trust> to_cut_;  ///< the newest segment is closed, and must be cut to what is on the disk for certain
  std::uint32_t next_segment_ = 0;
  std::deque<FinishedSegment> finished_;  ///< finished segments that are not deleted
  std::uint64_t finished_sets_ = 0;       ///< number of sets in all finished segments
  /// A mark that was made while no segment was open: it belongs to the first set of the next one.
  struct EarlyMark {
    std::string text;
    Instant at;
  };
  std::vector<EarlyMark> early_marks_;
  std::deque<SeamChange> seams_ahead_;
  struct Flight {
    std::optional<hal::FileHandle> file;  ///< empty: the disk failed
    take::PieceHashes hashes;
  };
  std::optional<Flight> flight_;
  bool unsynced_ = false;
  bool failed_ = false;  ///< the open segment had an error
  bool thumbnail_tried_ = false;
};

}  // namespace nodal::firmware
