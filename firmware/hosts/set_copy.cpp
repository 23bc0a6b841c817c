#include "firmware/hosts/set_copy.h"

#include <cstring>
#include <utility>

namespace nodal::firmware {
namespace {

void copy_picture(const ImageView& from, const MutableImageView& into) {
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(from.format)); ++c) {
    const PlaneView& source = from.planes[c];
    const MutablePlaneView& target = into.planes[c];
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
}

}  // namespace

SetCopy SetCopy::places_for(const HeadShapes& heads, std::shared_ptr<std::vector<std::uint8_t>> bytes) {
  SetCopy copy;
  std::size_t total = 0;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (!heads[i] || heads[i]->format == PixelFormat::kMjpeg) continue;
    copy.places[i] = {*heads[i], total, {}};
    copy.wanted |= head_bit(i);
    total += packed_size(heads[i]->format, heads[i]->width, heads[i]->height);
  }
  bytes->resize(total);
  copy.bytes = std::move(bytes);
  return copy;
}

void SetCopy::fill(const FrameSet& from) {
  set = from.number;
  mid_exposure = from.mid_exposure;
  sync = from.sync;
  heads = 0;
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if (!from.has(i) || (wanted & head_bit(i)) == 0) continue;
    Place& place = places[i];
    const HeadShape& shape = place.shape;
    const ImageView& picture = from.frames[i].image;
    if (picture.format != shape.format || picture.width != shape.width || picture.height != shape.height) continue;
    copy_picture(picture, packed_image(shape.format, shape.width, shape.height, bytes->data() + place.offset));
    place.in_effect = from.frames[i].in_effect;
    heads |= head_bit(i);
  }
}

}  // namespace nodal::firmware
