// Prepares pictures before the blend, for heads that need it: sharpens and downscales them, and makes low pictures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Bytes that prepare_picture needs for a head; 0 when the blend takes its picture as it is.
std::size_t prepared_size(const BlendTable::Source& source);

/// Fills views[0 .. source.pictures()) with the pictures of a head that the blend reads (Pictures): the picture itself,
/// or pictures made in `memory`, each component in its own plane, with rows that begin at multiples of 64 bytes:
///
///   level 0, where Source::sharpen is not 0:   s + sharpen * (4 s - its four neighbours kSharpenReach away) / 64
///   level l + 1:                               the mean of 2x2 samples of level l, not sharpened; an odd last row
///                                              or column is dropped; only the rows of Source::made, the others keep
///                                              what the memory held
///
/// all rounded half up and clamped to 0 .. 255, in every component's own grid (YUYV, UYVY and I422 as by halved_chroma,
/// and stored as I420); beyond the picture's edge the edge sample is repeated.
///
/// and, if source.low_size is not 0, the low picture of `picture`, see low_picture.h.
///
/// Threading: thread-safe for different heads.
/// Ownership: the views refer to `picture` and `memory`. Allocates nothing.
/// Errors: none; the picture must match `source`.
void prepare_picture(const BlendTable::Source& source, const ImageView& picture, std::uint8_t* memory,
                     std::span<ImageView> views);

}  // namespace nodal::blend
