// Pictures as frames of Ut Video, a lossless codec that FFmpeg and its relatives decode: Huffman codes of the
// differences between neighbours in a row.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Whether there is a kind of Ut Video for such pictures: Y U V with halved chroma of even size, and R G B.
bool ut_video_codes(PixelFormat format, int width, int height);
/// Matroska's codec and the CodecPrivate of such a stream: a BITMAPINFOHEADER with its FourCC, and one slice. FFmpeg's
/// decoder says of a stream that is marked as interlaced that the bottom field was exposed first, whatever the
/// container says, and its filters take frames without the mark for top field first. So only bottom-first streams are
/// marked; not those whose height its decoder would cut: of a multiple of 2 rows, or of 4 where chroma has half of
/// them.
inline constexpr std::string_view kUtVideoCodec = "V_MS/VFW/FOURCC";
std::vector<std::uint8_t> ut_video_private(PixelFormat format, int width, int height, ColourCoding coding,
                                           Fields fields);
/// No frame is larger.
std::size_t ut_video_most_bytes(PixelFormat format, int width, int height);

/// Threading: thread-bound.
/// Ownership: owns its memory; allocates only for larger pictures than before.
/// Errors: none; ut_video_codes() holds for the pictures.
class UtVideoEncoder {
 public:
  void encode(const ImageView& picture, std::vector<std::uint8_t>& into);

 private:
  void encode_plane(std::vector<std::uint8_t>& into, std::size_t& size);
  std::vector<std::uint8_t> first_, plane_, differences_;
};

/// Decodes a frame of UtVideoEncoder to a tightly packed picture of `format`. Other encoders' frames may have codes
/// that are too long, or another prediction. Errors: kBadFormat, kTruncated.
Status decode_ut_video(std::span<const std::uint8_t> frame, PixelFormat format, int width, int height,
                       std::vector<std::uint8_t>& into);

}  // namespace nodal::media
