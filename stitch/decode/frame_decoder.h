// Decodes one head's frames to pictures that the blend can read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/decode/jpeg_frame.h"

namespace nodal::decode {

/// Decodes MJPEG, Bayer and YUV411 frames to the format that the blend reads (blended_format()), and converts Y U V of
/// another ColourCoding to full range BT.601 in the same format.
///
/// Threading: thread-bound; different decoders are independent.
/// Ownership: owns the memory of the decoded picture, which is allocated once. Pages of it that are never written take
///   no memory, so a decoder for a head whose frames need no decoding costs nothing.
class FrameDecoder {
 public:
  /// Decodes frames of `delivered`, width x height px, that are blended as `blended`.
  FrameDecoder(PixelFormat delivered, PixelFormat blended, int width, int height);

  /// Whether the decoder is for such a frame.
  bool takes(const ImageView& frame) const;
  /// Whether decode() has work to do; otherwise the blend reads the frame in place.
  bool needed(const ImageView& frame) const;
  /// Makes `picture` a view of the decoded frame, which is valid until the next call. The frame is one that takes() and
  /// needed() are true for. After a fault `picture` is empty.
  DecodeFault decode(const ImageView& frame, ImageView& picture);
  /// The same into memory of the caller, packed_image() of the blended format.
  DecodeFault decode_into(const MutableImageView& into, const ImageView& frame);

 private:
  PixelFormat delivered_;
  PixelFormat blended_;
  int width_;
  int height_;
  std::unique_ptr<std::uint8_t[]> memory_;  // uninitialized
  std::vector<std::uint8_t> scratch_;
  JpegDecoder jpeg_;
};

}  // namespace nodal::decode
