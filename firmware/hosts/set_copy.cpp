#include "firmware/hosts/set_copy.h"

#include <cstring>
#include <utility>

#include "firmware/frame/pack_picture.h"

namespace nodal::firmware {
SetCopy SetCopy::places_for(const HeadShapes& heads, std::shared_ptr<std::vector<std::uint8_t>> bytes) {
  SetCopy copy;
  std::size_t total = 0;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (!heads[i]) continue;
    const PixelFormat as = heads[i]->format == PixelFormat::kMjpeg ? PixelFormat::kI420 : heads[i]->format;
    SetCopy::Place& place = copy.places[i];
    place.shape = *heads[i];
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
  std::size_t end = 0;
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if (!from.has(i) || (wanted & head_bit(i)) == 0) continue;
    Place& place = places[i];
    const HeadShape& shape = place.shape;
    const ImageView& picture = from.frames[i].image;
    if (picture.format != shape.format || picture.width != shape.width || picture.height != shape.height) continue;
    place.offset = end;
    std::uint8_t* const to = bytes->data() + end;
    if (shape.format == PixelFormat::kMjpeg) {
      if (picture.bytes > place.room) continue;
      std::memcpy(to, picture.planes[0].data, picture.bytes);
      place.bytes = picture.bytes;
    } else {
      pack_picture(picture, to);
      place.bytes = place.room;
    }
    place.coding = picture.coding;
    place.in_effect = from.frames[i].in_effect;
    heads |= head_bit(i);
    end += place.bytes;
  }
  bytes->resize(end);
}

}  // namespace nodal::firmware
