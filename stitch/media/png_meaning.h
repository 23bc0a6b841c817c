// What the chunks of a PNG say beside its pixels: colour, Exif, XMP. Internal to stitch/media.
#pragma once

#include <png.h>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// Bytes of a decompressed chunk, and the number of chunks of text that are kept.
inline constexpr std::uint32_t kMaxPngChunkBytes = 4U << 20;
inline constexpr std::uint32_t kMaxPngTexts = 32;

/// Bounds what a file's chunks may take; called before anything is read. libpng leaves iCCP to read_meaning(), because
/// it drops profiles that do not fit the picture without an error.
void limit_chunks(png_structp png);

/// Sets the meaning (except alpha) and the metadata of a picture, by the chunks that were read so far: those of the
/// meaning stand before the picture, others may stand behind it. Calls nothing of libpng that can fail.
void read_meaning(png_structp png, png_infop info, SampleMeaning& meaning, FileMetadata& metadata);

}  // namespace nodal::media
