// Measures what the disk of the takes sustains.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// What was measured.
struct DiskSpeed {
  std::uint64_t bytes = 0;  ///< written and synced
  Duration took;
  Duration worst_sync;
  std::uint64_t bytes_a_second() const;
};

/// A way to store pictures, [takes] mode, at the rig's heads and rate.
struct DiskVerdict {
  std::string mode;                  ///< "driver", "lossless", "jpeg"
  std::uint64_t bytes_a_second = 0;  ///< write rate that this mode needs; estimated for JPEG
  bool sustained = false;
  std::string why;  ///< a sentence for people
};

/// A mode is sustained if the disk takes a quarter more than it needs, and if the memory for pictures holds what comes
/// in during the longest sync.
DiskVerdict judge_disk(const DiskSpeed& speed, std::string_view mode, std::uint64_t needed, std::uint64_t buffer_bytes);

/// Writes a file in pieces and syncs as often as a take does. Removes it with the object; one that a killed nodald left
/// is removed by remove_leftover(). Durations are those between the calls of step(), which are made one right after the
/// other.
///
/// Threading: thread-bound to the disk's stage; a step blocks on the disk.
/// Ownership: the disk outlives it.
/// Errors: the disk's; kDiskFull if it has less than kMinRoom.
class DiskTest {
 public:
  /// `length` is within kShortest and kLongest.
  static Result<std::unique_ptr<DiskTest>> begin(hal::DiskPort& disk, Duration length, Instant now);
  ~DiskTest();
  DiskTest(const DiskTest&) = delete;
  DiskTest& operator=(const DiskTest&) = delete;

  /// One write or one sync; what was measured, when it is done.
  Result<std::optional<DiskSpeed>> step(Instant now);
  std::uint32_t percent(Instant now) const;
  /// Shortens the test to this time since its beginning, if it is longer.
  void end_after(Duration length) { length_ = std::min(length_, length); }

  static void remove_leftover(hal::DiskPort& disk);
  /// In the root of the takes' disk. No take has such a name.
  static const std::string kFile;

  static constexpr Duration kShortest = Duration::seconds(1);
  static constexpr Duration kLongest = Duration::seconds(60);
  static constexpr std::size_t kPiece = std::size_t{4} << 20;
  static constexpr std::uint64_t kMaxBytes = std::uint64_t{4} << 30;
  static constexpr std::uint64_t kMinRoom = std::uint64_t{256} << 20;
  static constexpr Duration kSyncEvery = Duration::milliseconds(500);

 private:
  DiskTest(hal::DiskPort& disk, Duration length, std::uint64_t most_bytes, Instant now);

  hal::DiskPort& disk_;
  Duration length_;
  const std::uint64_t most_bytes_;
  const Instant start_;
  hal::FileHandle file_ = 0;
  std::vector<std::uint8_t> piece_;
  DiskSpeed speed_;
  std::uint64_t written_ = 0;
  Instant synced_at_;
  std::optional<Instant> syncing_since_;
};

}  // namespace nodal::firmware
