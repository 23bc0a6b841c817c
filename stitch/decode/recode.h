// Y U V of another range or matrix to that of blended pictures.
#pragma once

#include "protocol/base/image.h"

namespace nodal::decode {

/// Converts `from`, whose Y U V are coded as from.coding says, to full range BT.601 in `into`, which has the same
/// format and size, and may be the same memory. Only for formats with chroma. Each sample is within one level of the
/// exact value, clipped to 0..255. A pixel's luma is computed with the chroma sample of its block, without
/// interpolation.
///
/// Source: ITU-R BT.601-7 and BT.709-6 (E'Y, E'CB, E'CR and their quantization).
void recode(const ImageView& from, const MutableImageView& into);

}  // namespace nodal::decode
