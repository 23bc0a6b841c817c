// A file of a coded picture with any bytes, for the targets heif and webp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "stitch/media/heif_webp/reader.h"

namespace nodal::fuzz {

/// Larger pictures are not decoded: a file of some bytes may claim any size, and reader.cpp checks it.
inline constexpr std::int64_t kMaxCoded = std::int64_t{1} << 18;

/// Reads the header, then colours and opacity. Results have the size that the header says, and all metadata a limit.
template <class Header, class Decode, class Opacity>
void read_coded(std::span<const std::uint8_t> bytes, Header header_of, Decode decode, Opacity opacity_of) {
  const Result<ImageHeader> header = header_of(bytes, "fuzz");
  if (!header) {
    NODAL_ASSERT(!header.error().message.empty());
    return;
  }
  NODAL_ASSERT(std::max({header->meaning.icc.size(), header->metadata.exif.size(), header->metadata.xmp.size()}) <=
               media::kMaxCodedMetadata);
  if (header->width < 1 || header->height < 1 || std::int64_t{header->width} * header->height > kMaxCoded) return;
  const auto pixels = static_cast<std::size_t>(header->width) * static_cast<std::size_t>(header->height);
  const Result<DecodedImage> image = decode(bytes, *header, "fuzz");
  NODAL_ASSERT(!image || image->bytes.size() == 3 * pixels);
  const Result<DecodedImage> opacity = opacity_of(bytes, *header, "fuzz");
  NODAL_ASSERT(!opacity || opacity->bytes.size() == pixels);
}

}  // namespace nodal::fuzz
