// Before the blend, for heads that ask for it: sharpened pictures, and smaller ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Bytes that prepare_picture needs for a head; 0 when the blend takes its picture as it is.
std::size_t prepared_size(const BlendTable::Source& source);

/// Leaves in views[0 .. source.levels) what the blend is given of a head (Pictures), made in `memory` where the picture
/// itself will not do; each component in rows of its own, which begin at multiples of 64 bytes:
///
///   level 0, where Source::sharpen is not 0:   s + sharpen * (4 s - the four kSharpenReach to its sides) / 64
///   level l + 1:                               the mean of the 2x2 samples of level l, not sharpened; what is left over
///                                              of odd sizes falls away
///
/// all rounded, halves up, and clamped to 0 .. 255, in every component's own grid (YUYV and UYVY as halved_chroma has
/// them, and from there on I420); beyond the picture's edge the edge is repeated.
///
/// Threading: thread-safe; one head a thread.
/// Ownership: the views are of `picture` and `memory`. Allocates nothing.
/// Errors: none; the picture is what `source` says.
void prepare_picture(const BlendTable::Source& source, const ImageView& picture, std::uint8_t* memory,
                     std::span<ImageView> views);

}  // namespace nodal::blend
