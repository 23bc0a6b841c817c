#include "stitch/decode/frame_decoder.h"

#include "stitch/decode/bayer.h"
#include "stitch/decode/recode.h"
#include "stitch/decode/yuv411.h"

namespace nodal::decode {

FrameDecoder::FrameDecoder(PixelFormat delivered, PixelFormat blended, int width, int height)
    : delivered_(delivered),
      blended_(blended),
      width_(width),
      height_(height),
      memory_(std::make_unique_for_overwrite<std::uint8_t[]>(packed_size(blended, width, height))) {}

bool FrameDecoder::takes(const ImageView& frame) const {
  return frame.format == delivered_ && frame.width == width_ && frame.height == height_;
}

bool FrameDecoder::needed(const ImageView& frame) const {
  return delivered_ != blended_ || (has_chroma(delivered_) && frame.coding != ColourCoding{});
}

DecodeFault FrameDecoder::decode_into(const MutableImageView& into, const ImageView& frame) {
  if (delivered_ == PixelFormat::kMjpeg) return jpeg_.decode({frame.planes[0].data, frame.bytes}, into);
  if (is_bayer(delivered_)) {
    demosaic(frame, into, scratch_);
  } else if (delivered_ == PixelFormat::kYuv411) {
    unpack_411(frame, into);
  } else {
    recode(frame, into);
  }
  return DecodeFault::kNone;
}

DecodeFault FrameDecoder::decode(const ImageView& frame, ImageView& picture) {
  const DecodeFault fault = decode_into(packed_image(blended_, width_, height_, memory_.get()), frame);
  picture = {};
  if (fault == DecodeFault::kNone) {
    picture = packed_image(blended_, width_, height_, static_cast<const std::uint8_t*>(memory_.get()));
  }
  return fault;
}

}  // namespace nodal::decode
