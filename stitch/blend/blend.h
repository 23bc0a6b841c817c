#pragma once

#include <span>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Blends one frame set into rows [row_begin, row_end) of the raymap. row_begin is even where chroma is
/// halved, row_end too unless it is the last. This scalar code is the specification: every other kernel gives
/// the same bytes. Of one component of one raymap sample, with every sum exact in 64 bits:
///
///   sample = s + sharpen * (4 s - its four neighbours) / 64                rounded, halves up; 0 .. 255; the
///            picture's edge is repeated beyond it. Where sharpen is 0: s
///   tap    = bilinear mean of its 2x2 samples                              exact
///   light  = (tap - black) * min(kMaxGain, round(tap gain * head gain))    gains multiply about black
///   result = black + sum(light * weight) / sum(weight)                     rounded once, halves up; 0 .. 255
///
/// A head that is missing has planes[0].data == nullptr: its taps are left out of both sums, so the others
/// take its share; a sample that no head is left for, or none was there for, gets the component's black.
///
/// The table has been validated, every head's picture is what table.sources says, and the raymap what
/// table.format says; nothing is checked here. Planes are read where they lie, whatever their strides.
///
/// Threading: thread-safe; call with disjoint rows from as many threads as you like: any split gives the
/// same bytes.
/// Ownership: none. Allocates nothing.
/// Errors: none.
void blend_rows(const BlendTable& table, std::span<const ImageView> heads, const MutableImageView& raymap,
                int row_begin, int row_end);

/// How much of each raymap pixel the heads that are there made, for rows [row_begin, row_end): 255 where no
/// head is missing, 0 where nothing is left (the pixel is black), else the share of the weight that was there,
/// 1 .. 254. Only heads[i].planes[0].data is looked at, for being null.
///
/// Threading, ownership, errors: as blend_rows. `validity` has the raymap's size.
void validity_rows(const BlendTable& table, std::span<const ImageView> heads, const MutablePlaneView& validity,
                   int row_begin, int row_end);

}  // namespace nodal::blend
