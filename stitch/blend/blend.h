#pragma once

#include <span>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Blends one frame set into rows [row_begin, row_end) of the raymap; both even where chroma is halved. This
/// scalar code is the specification: every other kernel gives the same bytes.
///
/// The table has been validated and every head's picture is what table.sources says; nothing is checked here.
/// A head that is missing has planes[0].data == nullptr: its taps are left out and the others' weights are
/// scaled up to one; a sample that no head is left for gets the component's black.
///
/// Threading: thread-safe; call with disjoint rows from as many threads as you like.
/// Ownership: none. Allocates nothing.
/// Errors: none.
void blend_rows(const BlendTable& table, std::span<const ImageView> heads, const MutableImageView& raymap,
                int row_begin, int row_end);

}  // namespace nodal::blend
