#include "host_tool/input/head_frame.h"

#include <algorithm>

#include "stitch/decode/frame_decoder.h"

namespace nodal::host {

Result<DecodedImage> picture_of_frame(const ImageView& frame, const std::string& head) {
  const PixelFormat delivered = frame.format;
  const PixelFormat raymap = has_chroma(delivered) ? PixelFormat::kI420 : delivered;
  const bool coded = delivered == PixelFormat::kMjpeg || is_bayer(delivered);
  const PixelFormat to = blended_format(delivered, coded ? PixelFormat::kI420 : raymap).value_or(delivered);
  decode::FrameDecoder decoder(delivered, to, frame.width, frame.height);
  DecodedImage picture{to, frame.width, frame.height, {}};
  if (!decoder.needed(frame)) {
    picture.bytes.assign(frame.planes[0].data, frame.planes[0].data + frame.bytes);
    return picture;
  }
  if (is_bayer(delivered) && std::min(frame.width, frame.height) < 4) {
    return fail(Errc::kBadFormat, "head '" + head + "': its picture is too small");
  }
  picture.bytes.resize(packed_size(to, frame.width, frame.height));
  const auto fault = decoder.decode_into(packed_image(to, frame.width, frame.height, picture.bytes.data()), frame);
  if (fault != decode::DecodeFault::kNone) {
    return fail(Errc::kBadFormat, "head '" + head + "': its pictures " + std::string(decode_fault_text(fault)));
  }
  return picture;
}

}  // namespace nodal::host
