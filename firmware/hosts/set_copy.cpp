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
    if (!heads[i]) continue;
    const PixelFormat as = heads[i]->format == PixelFormat::kMjpeg ? PixelFormat::kI420 : heads[i]->format;
    SetCopy::Place& place = copy.places[i];
    place.shape = *heads[i];
    place.offset = total;
    place.room = packed_size(as, heads[i]->width, heads[i]->height);
    copy.wanted |= head_bit(i);
    total += place.room;
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
    std::uint8_t* const to = bytes->data() + place.offset;
    if (shape.format == PixelFormat::kMjpeg) {
      if (picture.bytes > place.room) continue;
      std::memcpy(to, picture.planes[0].data, picture.bytes);
      place.bytes = picture.bytes;
    } else {
      copy_picture(picture, packed_image(shape.format, shape.width, shape.height, to));
      place.bytes = place.room;
    }
    place.coding = picture.coding;
    place.in_effect = from.frames[i].in_effect;
    heads |= head_bit(i);
  }
}

}  // namespace nodal::firmware
