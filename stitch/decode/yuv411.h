// Packed 4:1:1 of IIDC cameras to planar 4:2:2.
#pragma once

#include "protocol/base/image.h"

namespace nodal::decode {

/// Unpacks `from` (YUV411) to `into` (I422 of the same size). A chroma sample is at the first of its four pixels; the
/// sample of the third is the mean of this one and the next, rounded half up, and at the right edge the same one. Then
/// recode() if from.coding is not full range BT.601.
///
/// Source: TA Document 2003017, IIDC 1394-based Digital Camera Specification 1.31, 4.14 (the order of bytes).
void unpack_411(const ImageView& from, const MutableImageView& into);

}  // namespace nodal::decode
