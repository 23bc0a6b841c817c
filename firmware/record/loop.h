// Which segments go when a disk is full that records in a loop.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/documents.h"

namespace nodal::firmware {

/// Before and after each mark, so much is kept.
inline constexpr Duration kKeptAroundMarks = Duration::seconds(60);

/// Whether the sets of a segment, [first, last], are within kKeptAroundMarks of a mark at the take's rate.
bool near_mark(std::uint64_t first, std::uint64_t last, std::span<const take::Manifest::Mark> marks, FrameRate rate);

/// What may be deleted of a finished take.
struct RoomInTake {
  std::uint64_t bytes = 0;  ///< bytes of the segments that are not near a mark
  bool all = false;         ///< no segment of the take is near a mark
};
/// Errors: as trim_take().
Result<RoomInTake> room_in_take(hal::DiskPort& disk, const std::string& folder);

struct Trimmed {
  std::uint64_t bytes = 0;  ///< size of the deleted segment
  take::Manifest manifest;  ///< the take's new one
};

/// Deletes the oldest segment of a finished take that is not near a mark: its manifest is replaced first, so that the
/// take is whole after a power failure at any moment. Also removes files of segments that an interrupted call left.
/// Nothing if the marks keep all that is left.
/// Errors: the disk's; those of the take's documents and evidence, which name their file.
Result<std::optional<Trimmed>> trim_take(hal::DiskPort& disk, const std::string& folder);

}  // namespace nodal::firmware
