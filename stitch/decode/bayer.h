// Pictures behind a Bayer mosaic to full colour.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/image.h"

namespace nodal::decode {

/// Interpolates the two missing colours of every pixel of `mosaic` (is_bayer(), at least 4 x 4 px) and writes the
/// picture to `into`, which has the same size and is I420, RGB24 or GREY. Integers: the filters are exact and rounded
/// half up. At the edges the mosaic is mirrored about its outermost row or column.
///
/// Source: H. Malvar, L. He, R. Cutler, High-quality linear interpolation for demosaicing of Bayer-patterned color
/// images, ICASSP 2004.
///
/// `memory` is scratch memory; given again for pictures of the same size, it is not allocated again.
void demosaic(const ImageView& mosaic, const MutableImageView& into, std::vector<std::uint8_t>& memory);

}  // namespace nodal::decode
