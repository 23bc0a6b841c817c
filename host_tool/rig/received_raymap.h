// A raymap as a rig sends it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "host_tool/rig/bulk_item.h"
#include "protocol/base/result.h"
#include "stitch/media/raymap/raymap.h"

namespace nodal::host {

/// The metadata in a header as it came over the link.
/// Errors: those of parse_clean(); kBadFormat for a size that no rig produces.
Result<media::RaymapMeta> parse_raymap_meta(const std::string& header);

/// The largest possible number of bytes of a raymap with this metadata; the exact number if it is raw.
/// Errors: kUnsupported for an unknown coding.
Result<std::uint64_t> most_raymap_bytes(const media::RaymapMeta& meta);

/// Refuses inconsistent raymaps: a size that does not match the coding, a JPEG without start or end marker. Errors:
/// kBadFormat, kTruncated, kUnsupported.
Status check_raymap(const media::Raymap& raymap);

/// Assembles raymaps from their pieces.
///
/// Threading: thread-bound.
/// Ownership: owns the bytes of the raymap that is not complete.
/// Errors: those of parse_raymap_meta(), most_raymap_bytes() and BulkItemBytes; kBadFormat for another coding.
class RaymapAssembly {
 public:
  /// `coding`: "jpeg"; empty: any other.
  explicit RaymapAssembly(std::string coding) : coding_(std::move(coding)) {}

  /// Adds a piece; returns the complete raymap after its last piece.
  Result<std::optional<media::Raymap>> add(const BulkPiece& piece);

 private:
  Status begin(const BulkPiece& piece);

  std::string coding_;
  media::RaymapMeta meta_;
  BulkItemBytes bytes_;
};

}  // namespace nodal::host
