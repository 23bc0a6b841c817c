#include "firmware/frame/pack_picture.h"

#include <cstring>

namespace nodal::firmware {
namespace {

/// Whether components c and 0 alternate in memory as in a packed picture, only with another row stride, so that
/// component 0's rows hold both.
bool rides_along(const ImageView& picture, const MutableImageView& packed, std::size_t c) {
  const PlaneView& plane = picture.planes[c];
  return packed.planes[c].data - packed.planes[0].data < packed.planes[0].row_stride &&
         plane.data - picture.planes[0].data == packed.planes[c].data - packed.planes[0].data &&
         plane.row_stride == picture.planes[0].row_stride && plane.pixel_stride == packed.planes[c].pixel_stride;
}

void copy_plane(const PlaneView& source, const MutablePlaneView& target) {
  for (int row = 0; row < source.height; ++row) {
    const std::uint8_t* read = source.data + row * source.row_stride;
    std::uint8_t* write = target.data + row * target.row_stride;
    if (source.pixel_stride == 1 && target.pixel_stride == 1) {
      std::memcpy(write, read, static_cast<std::size_t>(source.width));
      continue;
    }
    for (int i = 0; i < source.width; ++i) write[i * target.pixel_stride] = read[i * source.pixel_stride];
  }
}

}  // namespace

void pack_picture(const ImageView& picture, std::uint8_t* to) {
  const MutableImageView packed = packed_image(picture.format, picture.width, picture.height, to);
  const auto components = static_cast<std::size_t>(component_count(picture.format));
  bool interleaved = components > 1 && picture.planes[0].pixel_stride == packed.planes[0].pixel_stride;
  // The lowest address of row 0, in both pictures the same component.
  const std::uint8_t* first = picture.planes[0].data;
  for (std::size_t c = 1; c < components && interleaved; ++c) {
    interleaved = rides_along(picture, packed, c);
    if (picture.planes[c].data < first) first = picture.planes[c].data;
  }
  if (!interleaved) {
    for (std::size_t c = 0; c < components; ++c) copy_plane(picture.planes[c], packed.planes[c]);
    return;
  }
  for (int row = 0; row < picture.height; ++row) {
    std::memcpy(to + row * packed.planes[0].row_stride, first + row * picture.planes[0].row_stride,
                static_cast<std::size_t>(packed.planes[0].row_stride));
  }
}

}  // namespace nodal::firmware
