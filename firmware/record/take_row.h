// What the recorder gives to the disk's stage: the pictures of some sets, in the recorder's memory.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/frame/frame_set.h"
#include "hal/head.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "protocol/take/stream.h"

namespace nodal::firmware {

/// Why a frame in a file is not a picture of its head.
enum class Placeholder : std::uint8_t {
  kNone,     ///< it is a picture
  kMissing,  ///< the head has no frame in the set; the head's losses say why
  kFormat,   ///< its size or format differs from that of the segment, which has just begun
  kEncoder,  ///< it could not be encoded, or decoded to be stored raw
};
std::string_view placeholder_name(Placeholder reason);

struct RecordedFrame {
  std::span<const std::uint8_t> bytes;  ///< empty for a placeholder
  Placeholder placeholder = Placeholder::kMissing;
  Duration offset;  ///< mid-exposure after the set's
  hal::HeadSettings in_effect;
  std::uint32_t sequence = 0;
  int quality = 0;  ///< quality of a JPEG that the rig encoded; 0: stored as the head delivered it
};

struct RecordedSet {
  std::uint64_t number = 0;
  Instant mid_exposure;
  std::uint64_t missed = 0;  ///< sets between the one before and this one that are not recorded
  SyncEvidence sync;
  std::array<RecordedFrame, kMaxHeads> frames;
};

struct RecordedRaymap {
  std::uint64_t set = 0;
  Instant mid_exposure;
  std::span<const std::uint8_t> jpeg;
};

/// A calibration that was put in force while a take is recorded.
struct TakeCalibration {
  std::uint64_t first_set = 0;  ///< number of the first set that is blended with it
  Sha256 id{};
  std::string json;  ///< its canonical form
};

/// One cluster of every head: at most MatroskaWriter::kLongestCluster, kLargestCluster and kMaxSets. Its pictures lie
/// in the recorder's ring, and are valid until the disk's stage has released `ring_end`.
struct TakeRow {
  static constexpr std::size_t kMaxSets = 32;

  std::uint64_t take = 0;
  /// The same for all of the row's sets. A head without one has not delivered a picture in this take yet.
  std::array<std::optional<take::Stream>, kMaxHeads> streams;
  std::vector<RecordedSet> sets;
  std::vector<RecordedRaymap> raymaps;
  FrameRate rate;              ///< rate of its sets
  Duration second_field;       ///< how much later the second field of its first set was exposed than the first
  bool last = false;           ///< this row ends the take; it may have no sets
  std::uint64_t ring_end = 0;  ///< PictureRing::release() takes it when the row was written
};

}  // namespace nodal::firmware
