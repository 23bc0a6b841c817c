// A raymap as a rig sends it.
#pragma once

#include <cstdint>
#include <string>

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

}  // namespace nodal::host
