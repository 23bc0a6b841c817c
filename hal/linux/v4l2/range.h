// Converts video range, as sent by NTSC grabbers, to the full range of Nodal's pictures.
#pragma once

#include "protocol/base/image.h"

namespace nodal::hal::v4l2 {

/// Converts YUV from video range (ITU-R BT.601: Y 16..235, U and V 16..240) to full range, in place, with clipping.
/// Each sample is within 0.6 of the exact value. Pictures without chroma are treated as luma; R G B is unchanged.
void expand_video_range(const MutableImageView& picture);

}  // namespace nodal::hal::v4l2
