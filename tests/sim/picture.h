// Heads' pictures in every pixel format: one grey level, with room for a stamp.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "protocol/base/image.h"

namespace nodal::swarm {

/// kPictureWidth x kPictureHeight pixels of kPictureLevel. A JPEG has a comment of a stamp's size as its first segment.
std::vector<std::uint8_t> grey_picture(PixelFormat format, const ColourCoding& coding);

/// The view of a grey_picture().
ImageView picture_view(PixelFormat format, std::span<const std::uint8_t> picture);
MutableImageView writable_view(PixelFormat format, std::span<std::uint8_t> picture);

/// Whether it is a JPEG without its end.
bool is_cut(const ImageView& picture);

}  // namespace nodal::swarm
