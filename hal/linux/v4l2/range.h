// Video range, as NTSC grabbers send it, to the full range that Nodal's pictures have.
#pragma once

#include "protocol/base/image.h"

namespace nodal::hal::v4l2 {

/// Y U V of video range (ITU-R BT.601: Y 16..235, U and V 16..240) become full range, in place; what is outside is
/// clipped. Each sample is within 0.6 of the exact value. Pictures without chroma are taken for luma; R G B stays.
void expand_video_range(const MutableImageView& picture);

}  // namespace nodal::hal::v4l2
