// A raymap as received, and the files that are made from it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

enum class RaymapFormat { kJpg, kPng, kRaw };

/// "jpg", "png", "raw". Errors: kBadValue.
Result<RaymapFormat> parse_raymap_format(std::string_view text);
/// By a file name's extension; an unknown one is an error that lists the known ones.
Result<RaymapFormat> raymap_format_of_name(std::string_view name);

struct ReceivedRaymap {
  wire::RaymapHeader header;
  std::vector<std::uint8_t> bytes;
};

/// Bytes that a raymap of this header has at most: exactly so many when it is raw. Errors: kBadFormat for a size that no
/// rig makes, kUnsupported for a coding that is not known.
Result<std::uint64_t> most_raymap_bytes(const wire::RaymapHeader& header);

/// Refuses inconsistent raymaps: a size that does not match the coding, a JPEG without start or end marker.
/// Errors: kBadFormat, kTruncated, kUnsupported.
Status check_raymap(const ReceivedRaymap& raymap);

/// The PNG of a raymap that came raw, with GPano metadata when it is equirectangular. Y, U, V are full range, as in JPEG;
/// numbers of 16 bits stay as they are, and the file says that they are linear. Errors: kUnsupported, kInternal.
Result<std::vector<std::uint8_t>> encode_png(const ReceivedRaymap& raymap);

/// The sidecar that says what a raw file's bytes are: planes in order, their sizes and offsets.
std::string raw_sidecar(const ReceivedRaymap& raymap);

}  // namespace nodal::host
