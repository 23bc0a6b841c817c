// A head's pictures as JPEGs or Ut Video for the disk.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
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

namespace nodal::firmware {

/// Encodes one head's pictures of one format. With kLossless a picture becomes a frame of Ut Video. With kJpeg an
/// interlaced frame becomes two JPEGs one after the other, the top field first, each with an AVI1 segment; FFmpeg weaves
/// them to a frame again.
///
/// Threading: thread-bound to the recorder.
/// Ownership: owns the encoded bytes until the next call.
/// Errors: kInternal with TurboJPEG's message.
class HeadCoder {
 public:
  using Mode = TakesConfig::Mode;
  /// `delivered`: for which codes() holds.
  HeadCoder(const HeadStream& delivered, Mode mode);
  HeadCoder(HeadCoder&& other) noexcept;
  ~HeadCoder();

  /// Whether such pictures are encoded. MJPEG is stored as delivered, and a Bayer mosaic as it is, because JPEG
  /// would blur its colours and Ut Video has no such format.
  static bool codes(const HeadStream& delivered, Mode mode);
  /// What the files of such a head hold.
  static HeadStream coded(HeadStream delivered, Mode mode) {
    if (mode == Mode::kLossless) delivered.lossless = true;
    else delivered.format = PixelFormat::kMjpeg;
    return delivered;
  }

  /// One part, or two for an interlaced frame as JPEG. `quality` of JPEGs: 1 .. 100.
  using Parts = std::array<std::span<const std::uint8_t>, 2>;
  Result<Parts> encode(const ImageView& picture, int quality);

 private:
  struct Field {
    std::unique_ptr<media::JpegWriter> writer;
    std::vector<std::uint8_t> bytes;
  };
  std::unique_ptr<media::UtVideoEncoder> lossless_;  ///< null: JPEG
  std::vector<FieldParity> parities_;                ///< empty: progressive
  std::array<Field, 2> fields_;
};

/// "driver", "jpeg", "lossless".
std::string_view mode_name(TakesConfig::Mode mode);

}  // namespace nodal::firmware
