// A head's pictures as JPEGs for the disk.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "firmware/record/take_row.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::media {
class JpegWriter;
}

namespace nodal::firmware {

/// Encodes one head's pictures of one format. An interlaced frame becomes two JPEGs one after the other, the top field first,
/// each with an AVI1 segment; FFmpeg weaves them to a frame again.
///
/// Threading: thread-bound to the recorder.
/// Ownership: owns the encoded bytes until the next call.
/// Errors: kInternal with TurboJPEG's message.
class HeadCoder {
 public:
  /// `delivered`: for which codes() holds.
  explicit HeadCoder(const HeadStream& delivered);
  HeadCoder(HeadCoder&& other) noexcept;
  ~HeadCoder();

  /// Whether such pictures are encoded. MJPEG is stored as delivered, and a Bayer mosaic as it is, because JPEG
  /// would blur its colours.
  static bool codes(const HeadStream& delivered);
  /// What the files of such a head hold.
  static HeadStream coded(HeadStream delivered) {
    delivered.format = PixelFormat::kMjpeg;
    return delivered;
  }

  /// One part, or two for an interlaced frame. `quality` 1 .. 100.
  using Parts = std::array<std::span<const std::uint8_t>, 2>;
  Result<Parts> encode(const ImageView& picture, int quality);

 private:
  struct Field {
    std::unique_ptr<media::JpegWriter> writer;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<FieldParity> parities_;  ///< empty: progressive
  std::array<Field, 2> fields_;
};

}  // namespace nodal::firmware
