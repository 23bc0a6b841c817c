// A received raymap, and the conversion to picture files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_tool/console/console.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

/// zlib's level for raymaps as PNG: a third of the time of the default 6, for 5 % more bytes.
inline constexpr int kPngEffort = 3;

enum class RaymapFormat { kJpg, kPng, kTiff, kRaw };

/// "jpg", "png", "tif", "raw". Errors: kBadValue.
Result<RaymapFormat> parse_raymap_format(std::string_view text);
/// The format for a file name's extension; the error for an unknown one lists the known ones.
Result<RaymapFormat> raymap_format_of_name(std::string_view name);
/// The ending of a file's name for it, without the dot.
std::string_view ending_of(RaymapFormat format);

/// Refuses to write over a picture that is read: nothing could bring it back. `out` may number its `count` files.
/// Errors: kExists, kBadValue; those of numbered_name().
Status check_output(const std::string& out, const std::vector<std::vector<std::string>>& sets, std::size_t count);

/// Whether pictures can go to standard output. Errors: kBadValue.
Status check_pipe(const Console& console);

struct ReceivedRaymap {
  wire::RaymapHeader header;
  std::vector<std::uint8_t> bytes;
};

/// The largest possible number of bytes of a raymap with this header; the exact number if it is raw.
/// Errors: kBadFormat for a size that no rig produces, kUnsupported for an unknown coding.
Result<std::uint64_t> most_raymap_bytes(const wire::RaymapHeader& header);

/// Refuses inconsistent raymaps: a size that does not match the coding, a JPEG without start or end marker. Errors:
/// kBadFormat, kTruncated, kUnsupported.
Status check_raymap(const ReceivedRaymap& raymap);

/// The PNG of a raw raymap, with GPano metadata if it is equirectangular. YUV is full range, as in JPEG; 16-bit numbers
/// are unchanged, and the file records that they are linear. Errors: kUnsupported, kInternal.
Result<std::vector<std::uint8_t>> encode_png(const ReceivedRaymap& raymap);

/// The same as a TIFF. Errors: those of encode_png(), and kTooLarge for more than 4 GB.
Result<std::vector<std::uint8_t>> encode_tiff(const ReceivedRaymap& raymap);

/// The sidecar file that describes a raw file's bytes: the planes in order, their sizes and offsets.
std::string raw_sidecar(const ReceivedRaymap& raymap);

}  // namespace nodal::host
