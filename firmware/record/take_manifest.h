// The manifest of a take, from its finished segments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "firmware/record/recovery.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/take/documents.h"
#include "protocol/take/tally.h"

namespace nodal::firmware {

/// Sums up segments, in their order.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class ManifestSum {
 public:
  /// `heads`: of the take.
  ManifestSum(std::uint64_t take, std::string ended, std::size_t heads) : heads_(heads) {
    manifest_.number = take;
    manifest_.ended = std::move(ended);
  }
  void add(const FinishedSegment& segment);
  /// Whether all files of this segment can be listed, too.
  bool has_room(const FinishedSegment& segment) const;
  /// `recorded`: sets, deleted ones included.
  take::Manifest finish(std::uint64_t recorded);
  std::uint64_t sets() const { return manifest_.sets; }
  take::Manifest& manifest() { return manifest_; }

 private:
  take::Manifest manifest_;
  const std::size_t heads_;
  take::Tally tally_;
};

/// Files that a manifest lists beside those of segments.
inline constexpr std::size_t kOtherFiles = 8 + take::kMaxCalibrations;

/// write_manifest() reads no larger documents.
inline constexpr std::uint64_t kMaxDocumentBytes = std::uint64_t{1} << 20;

/// Adds the take's documents to a manifest whose segments are finished, and stores it.
Result<take::Manifest> write_manifest(hal::DiskPort& disk, const std::string& folder, take::Manifest manifest);

enum class Stored : std::uint8_t {
  kNew,       ///< a manifest must not exist yet; otherwise kExists
  kReplaced,  ///< the existing manifest is replaced
};

/// Writes a manifest durably. It is parsed before it is stored, and read back afterwards: a manifest that no
/// reader accepts does not count. Returns what was read. Errors: the disk's; those of take::parse_manifest().
Result<take::Manifest> store_manifest(hal::DiskPort& disk, const std::string& folder, take::Manifest manifest,
                                      Stored how);

}  // namespace nodal::firmware
