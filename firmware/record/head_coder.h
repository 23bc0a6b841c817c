// A head's pictures as a take stores them, where that is not what the head delivers.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/record/take_row.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::media {
class JpegWriter;
class UtVideoEncoder;
}  // namespace nodal::media
namespace nodal::decode {
class FrameDecoder;
}  // namespace nodal::decode

namespace nodal::firmware {

/// What the files of a head hold; equal to `delivered` where its pictures are stored as they are: MJPEG, but for kRaw,
/// and a Bayer mosaic, because JPEG would blur its colours and Ut Video has no such format. kRaw: MJPEG becomes what
/// the blend decodes it to for raymaps of format `raymap`.
take::Stream stored_stream(take::Stream delivered, TakeMode mode, PixelFormat raymap);

/// Codes one head's pictures of one format, or decodes them. A lossless picture is a frame of Ut Video. An interlaced
/// frame as JPEG is two JPEGs one after the other, the field exposed first is first, each with an AVI1 segment; FFmpeg
/// weaves them to a frame again. MJPEG is decoded as the blend decodes it.
///
/// Threading: thread-bound to the recorder.
/// Ownership: owns the coded bytes until the next call.
/// Errors: kInternal with TurboJPEG's message; kBadFormat for MJPEG that cannot be decoded.
class HeadCoder {
 public:
  /// `stored`: stored_stream() of `delivered`, and another.
  HeadCoder(const take::Stream& delivered, const take::Stream& stored);
  HeadCoder(HeadCoder&& other) noexcept;
  ~HeadCoder();

  /// One part, or two for an interlaced frame as JPEG. `quality` of JPEGs: 1 .. 100.
  using Parts = std::array<std::span<const std::uint8_t>, 2>;
  Result<Parts> code(const ImageView& picture, int quality);

 private:
  struct Field {
    std::unique_ptr<media::JpegWriter> writer;
    std::vector<std::uint8_t> bytes;
  };
  // One of them, or the writers of fields_.
  std::unique_ptr<media::UtVideoEncoder> lossless_;
  std::unique_ptr<decode::FrameDecoder> raw_;
  std::vector<FieldParity> parities_;  ///< empty: progressive
  std::array<Field, 2> fields_;
};

/// "driver", "raw", "jpeg", "lossless".
std::string_view mode_name(TakeMode mode);
/// The modes of the heads, each once: "jpeg", or "driver, raw".
std::string mode_names(std::span<const HeadConfig> heads);

}  // namespace nodal::firmware
