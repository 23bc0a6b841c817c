// Finishes takes that ended without being finished: by a power cut, a killed nodald or a failing disk.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "firmware/record/segment_writer.h"
#include "protocol/base/result.h"
#include "protocol/take/documents.h"
#include "protocol/take/tally.h"

namespace nodal::firmware {

/// A finished segment.
struct FinishedSegment {
  std::uint32_t number = 0;
  std::uint64_t first_set = 0;  ///< index in the take
  std::vector<take::Manifest::File> files;
  std::uint64_t sets = 0;
  Duration length;
  std::uint64_t cut_bytes = 0;  ///< bytes that were cut from the heads' files behind the newest complete set
  std::vector<take::Manifest::Mark> marks{};
  std::vector<take::Manifest::Calibration> calibrations{};  ///< those after the take's first, so far
  take::SegmentTally tally{};
};

/// How much of a segment is on the device for certain.
enum class Trust : std::uint8_t {
  kAll,      ///< everything was synced: another segment was begun after it
  kDurable,  ///< what its evidence calls durable; the rest is cut off: a sync failed
  kChecked,  ///< what it calls durable, and what is whole behind that: clusters are read and their CRC-32 checked
};

/// Whether the evidence is such as a reader of the take will accept; its error is that of the recovery.
using AcceptSegment = std::function<Status(const take::Segment&)>;

/// Cuts all files of a segment to the newest set that is whole in all of them, and finishes them. What is finished
/// already and whole is left as it is. Nothing if no set is whole: its files are removed then. `reason` is stored in
/// the evidence.
/// Errors: the disk's; those of the evidence, which name its file.
Result<std::optional<FinishedSegment>> recover_segment(const TakePlace& place, std::uint32_t segment, Trust trust,
                                                       const std::string& reason, const AcceptSegment& accept = {});

/// Whether the power failed while the documents of a take were written, so that it has no set. Errors: the disk's.
Result<bool> nothing_recorded(hal::DiskPort& disk, const std::string& folder);

/// Recovers every segment of a take and writes its manifest. A segment of which a file is missing, or whose evidence no
/// reader would accept, is left out: its other files stay, and the manifest says so in `ended`. The take's calibration
/// and take.json are read from its folder. Memory: that of one segment's evidence and of the manifest, at their limits.
/// `progress` is called for every piece that was read.
Result<take::Manifest> recover_take(hal::DiskPort& disk, const std::string& folder,
                                    const std::function<void()>& progress = {});

/// Cuts the flight record of a take after its last whole record. Nothing if there is none, or none is whole; its file
/// is removed then. Errors: the disk's.
Result<std::optional<take::Manifest::File>> recover_flight(hal::DiskPort& disk, const std::string& folder);

/// Removes the files of a segment. After a power failure within it, the segment is there, or without evidence, so that
/// it does not count. Errors: the disk's.
Status remove_segment(hal::DiskPort& disk, const std::string& folder, std::uint32_t segment);

}  // namespace nodal::firmware
