// Raymaps and other pictures that commands make, as files: the one place where their colours and metadata are written.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "stitch/media/raymap/kept_metadata.h"
#include "stitch/media/raymap/raymap.h"

namespace nodal::media {

enum class RaymapFormat : std::uint8_t { kJpg, kPng, kTiff, kRaw };

/// "jpg", "png", "tif", "raw". Errors: kBadValue.
Result<RaymapFormat> parse_raymap_format(std::string_view text);
/// The format for a file name's extension; the error for an unknown one lists the known ones.
Result<RaymapFormat> raymap_format_of_name(std::string_view name);
/// The ending of a file's name for it, without the dot.
std::string_view ending_of(RaymapFormat format);

/// How a picture is written.
struct RaymapFile {
  RaymapFormat format = RaymapFormat::kJpg;
  int quality = 92;       ///< quality of a JPEG
  std::string comment{};  ///< comment of a JPEG
  std::string layout{};   ///< viewers are told of a whole sphere (gpano.h); empty: a view, which has none
  KeptMetadata kept{};
  std::optional<SphereArea> area{};  ///< the part of an equirectangular raymap that the picture is
};

/// Numbers that are proportional to light are in sRGB in a JPEG, which has 8 bits; a PNG says that they are linear by
/// gAMA, a TIFF by a profile, and both by a comment. YUV is full range, as in JPEG.
/// Errors: kUnsupported, kTooLarge, kInternal of the writers.
Result<std::vector<std::uint8_t>> encode(const DecodedImage& picture, const RaymapFile& file);

/// A raymap that is not coded, as a PNG or a TIFF. Errors: kUnsupported for a coded one; those of encode().
Result<std::vector<std::uint8_t>> encode(const Raymap& raymap, RaymapFormat format);

}  // namespace nodal::media
