#pragma once

#include <cstdint>

#include "protocol/base/image.h"

namespace nodal::firmware {

/// Copies a picture, packed without padding, to `to`, which has packed_size() bytes. Not for kMjpeg.
void pack_picture(const ImageView& picture, std::uint8_t* to);

}  // namespace nodal::firmware
