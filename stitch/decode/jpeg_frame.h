// JPEG frames of cameras to planes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"

namespace nodal::decode {

/// Why a frame could not be decoded.
enum class DecodeFault : std::uint8_t {
  kNone = 0,
  kNoJpeg,       ///< the bytes are not a JPEG, or it ends in its header
  kBroken,       ///< it ends early, or its data are damaged
  kOtherSize,    ///< its size differs from the head's
  kOtherCoding,  ///< not Y U V or grey of 8 bits
  kSeveralScans  ///< progressive, or its components one after another
};
/// The fault as the end of a sentence about a head: "its JPEGs ...".
std::string_view decode_fault_text(DecodeFault fault);

/// The field that the first JPEG holds, if a frame is two JPEGs, one for each field. Top for anything else.
FieldParity first_field_of(std::span<const std::uint8_t> jpegs);

/// Decodes the frames of one camera.
///
/// Accepts frames without Huffman tables, as many cameras send them (the tables of ITU-T T.81, K.3 are then used), and
/// bytes that do not belong there before a marker. A frame with several scans is refused: each scan costs the time of a
/// whole picture, and no camera needs them.
///
/// Threading: thread-bound; different decoders are independent.
/// Ownership: owns scratch memory, for pictures of odd size and with other chroma than `into`.
/// Errors: see DecodeFault.
class JpegDecoder {
 public:
  JpegDecoder();

  /// `into` is I420, RGB24 or GREY, and the JPEG has its size. Chroma of any subsampling becomes that of I420: by means
  /// of its samples, or by linear interpolation where it is coarser. Two JPEGs of half the height, one behind the
  /// other, are the fields of an interlaced frame: the first is the top field, unless its AVI1 segment says that it is
  /// the bottom field. What `into` holds after a fault is undefined.
  DecodeFault decode(std::span<const std::uint8_t> jpeg, const MutableImageView& into);

 private:
  struct Close {
    void operator()(void* handle) const;
  };
  /// A JPEG whose header the decompressor has read.
  struct Opened {
    std::span<const std::uint8_t> jpeg;
    int width = 0;
    int height = 0;
    int subsampling = 0;
    bool bottom_field = false;  ///< it says that it is one
    std::size_t scan_at = 0;
  };
  DecodeFault try_to_decode(std::span<const std::uint8_t> jpeg, const MutableImageView& into);
  DecodeFault open(std::span<const std::uint8_t> jpeg, Opened& opened);
  DecodeFault decode_opened(const Opened& opened, const MutableImageView& into);
  int decode_planes(std::span<const std::uint8_t> jpeg, int subsampling, const MutableImageView& into);
  bool only_superfluous_bytes() const;

  std::unique_ptr<void, Close> handle_;
  std::vector<std::uint8_t> scratch_;
};

}  // namespace nodal::decode
