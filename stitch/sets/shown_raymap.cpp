#include "stitch/sets/shown_raymap.h"

#include <algorithm>
#include <utility>

namespace nodal::sets {

ShownRaymap::ShownRaymap() : level_of_(65536) {}

void ShownRaymap::set_levels(const blend::LinearScale& scale) {
  if (scale.shown_from == shown_from_) return;  // the usual case: exposures did not change
  shown_from_ = scale.shown_from;
  std::size_t number = 0;
  for (std::size_t level = 0; level < 256; ++level) {
    const std::size_t end = level < 255 ? std::max<std::size_t>(number, shown_from_[level + 1]) : level_of_.size();
    std::fill(level_of_.begin() + static_cast<std::ptrdiff_t>(number),
              level_of_.begin() + static_cast<std::ptrdiff_t>(end), static_cast<std::uint8_t>(level));
    number = end;
  }
}

ImageView ShownRaymap::in_8_bits(const ImageView& raymap, const std::optional<blend::LinearScale>& scale) {
  if (!is_linear16(raymap.format)) return raymap;
  if (scale) set_levels(*scale);
  const PixelFormat in_8 = nodal::in_8_bits(raymap.format);
  picture_.resize(packed_size(in_8, raymap.width, raymap.height));
  const MutableImageView picture = packed_image(in_8, raymap.width, raymap.height, picture_.data());
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(in_8)); ++c) {
    const PlaneView& from = raymap.planes[c];
    const MutablePlaneView& to = picture.planes[c];
    for (int y = 0; y < to.height; ++y) {
      const std::uint8_t* in = from.data + y * from.row_stride;
      std::uint8_t* out = to.data + y * to.row_stride;
      for (int x = 0; x < to.width; ++x, in += from.pixel_stride, out += to.pixel_stride) {
        *out = level_of_[static_cast<std::size_t>(in[0] | in[1] << 8)];
      }
    }
  }
  return packed_image(in_8, raymap.width, raymap.height, std::as_const(picture_).data());
}

}  // namespace nodal::sets
