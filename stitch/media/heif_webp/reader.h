// Pictures from HEIF and WebP files.
#pragma once

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

class PictureBytes;

/// Both formats code a picture of one colour in some bytes, so the length of a file says nothing of its picture.
inline constexpr std::uint64_t kMaxCodedPixels = std::uint64_t{1} << 28;
/// Length of an Exif block, an XMP packet or a colour profile, bytes; longer ones are left out, a profile is refused.
inline constexpr std::size_t kMaxCodedMetadata = std::size_t{1} << 20;

/// By the first bytes; files of other kinds, AVIF among them, are neither.
bool is_heif_or_webp(PictureBytes& file);

/// Whether decoding turns the picture upright, whatever its Exif says: in HEIF, but not in WebP.
bool is_turned(PictureBytes& file);

/// Number of pictures in a file, of which the primary one is read: several in an HEIF file with a burst; 1 in other
/// files, and in those that are broken.
int count_pictures(PictureBytes& file);

/// RGB24; alpha is left out. Of an HEIF file the primary picture, turned, mirrored and cut as the file says: the
/// orientation in its Exif is no longer true. An animated WebP is refused.
///
/// Threading: thread-safe.
/// Errors: each names the picture: kIo, kBadFormat when it is broken, kTruncated, kTooLarge, kUnsupported.
Result<DecodedImage> decode_heif_or_webp(PictureBytes& file);

/// Its size and metadata, without decoding it. Errors: the same, except those of its pixels.
Result<ImageHeader> heif_or_webp_header(PictureBytes& file);

/// How opaque the pixels are, GREY: 255 everywhere if the file has no alpha channel. Errors: the same.
Result<DecodedImage> decode_heif_or_webp_opacity(PictureBytes& file);

}  // namespace nodal::media
