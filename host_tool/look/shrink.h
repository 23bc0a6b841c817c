// Pictures made smaller for graphics that take none as large.
#pragma once

#include "protocol/base/decoded_image.h"

namespace nodal::host::look {

/// The picture with its longer side `side` px, each pixel the mean of what it covers; unchanged if it is not larger.
/// GREY or RGB24.
DecodedImage shrunk(const DecodedImage& picture, int side);

}  // namespace nodal::host::look
