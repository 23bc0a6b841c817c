// Views of pictures in memory: planes with a row stride and a pixel stride, so that YUYV and NV12 are read in the
// driver's buffer, without a copy.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace nodal {

/// YUV of raymaps and of blended pictures is full range BT.601 (0..255, as in JPEG). A head may deliver other YUV and
/// say so with a ColourCoding.
enum class PixelFormat : std::uint8_t {
  kGrey8 = 1,
  kI420 = 2,  ///< Y, U, V planes; chroma has half the width and height, centred
  kNv12 = 3,  ///< Y plane, then U and V interleaved; chroma has half the width and height
  kYuyv = 4,  ///< Y0 U Y1 V; chroma has half the width and is at the even luma samples
  kUyvy = 5,
  kRgb24 = 6,  ///< R G B bytes
  kMjpeg = 7,  ///< one JPEG picture; plane 0 holds its bytes in one row
  // For raymaps only: 16 bits per sample, low byte first. A rig's are linear light; those of files are as in the file.
  kGrey16 = 8,
  kRgb48 = 9,
  // From heads only.
  kI422 = 10,  ///< Y, U, V planes; chroma has half the width and is at the even luma samples
  // One sample per pixel behind a Bayer mosaic. The name gives the colours of two pixels of row 0, then of row 1.
  kRggb8 = 11,
  kGrbg8 = 12,
  kGbrg8 = 13,
  kBggr8 = 14,
  /// U Y0 Y1 V Y2 Y3, as IIDC cameras send it; chroma has a quarter of the width and is at every fourth luma sample.
  /// Samples of Y are not equally far apart, so plane 0 holds the bytes: rows of 6 bytes for 4 pixels, the last pixels
  /// padded.
  kYuv411 = 15,
};

/// How a picture's Y U V stand for R G B. Without meaning for other formats.
struct ColourCoding {
  bool video_range = false;  ///< Y is 16..235, U and V are 16..240 (ITU-R BT.601-7, 2.5.3); otherwise 0..255
  bool bt709 = false;        ///< the matrix of ITU-R BT.709; otherwise that of BT.601
  friend bool operator==(const ColourCoding&, const ColourCoding&) = default;
};

std::string_view pixel_format_name(PixelFormat format);
/// The format of this name; nothing if there is none.
std::optional<PixelFormat> pixel_format_named(std::string_view name);
/// Whether the format is Y with subsampled U and V, not grey or R G B.
bool has_chroma(PixelFormat format);
bool is_bayer(PixelFormat format);
/// Bytes of a row of kYuv411.
constexpr int yuv411_row_bytes(int width) { return 6 * ((width + 3) / 4); }
/// The format in which a head's pictures are blended into a raymap: the delivered one, if the blend reads it as it is,
/// or the one that each picture is decoded to. Nothing if the raymap cannot be made from such pictures.
std::optional<PixelFormat> blended_format(PixelFormat delivered, PixelFormat raymap);
/// Whether a raymap may have this format.
bool is_raymap_format(PixelFormat format);
/// is_linear16: linear light in 16 bits. in_8_bits: the format with the same components in 8 bits, or itself.
bool is_linear16(PixelFormat format);
PixelFormat in_8_bits(PixelFormat format);

/// One component's samples: sample (i, j) is at data[j * row_stride + i * pixel_stride]; strides are bytes.
template <class Byte>
struct BasicPlaneView {
  Byte* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t row_stride = 0;
  int pixel_stride = 1;
};
using PlaneView = BasicPlaneView<const std::uint8_t>;
using MutablePlaneView = BasicPlaneView<std::uint8_t>;

/// The position of a component's sample grid in the full picture: u_plane = u_full / step + offset; pixel centres are
/// at half-integers on both sides.
struct PlaneGrid {
  int step_x = 1;
  int step_y = 1;
  double offset_x = 0.0;
  double offset_y = 0.0;
};

inline constexpr int kMaxPlanes = 3;

/// Number of planes of a format: 1 for grey, Bayer, MJPEG and YUV411, else 3 (Y U V or R G B).
int component_count(PixelFormat format);
/// The position of component c's samples in the picture; c < component_count(format).
PlaneGrid component_grid(PixelFormat format, int c);
/// Bytes of a tightly packed picture; 0 for kMjpeg, whose size depends on its content.
std::size_t packed_size(PixelFormat format, int width, int height);

/// A view of a picture. planes[c] is component c (Y U V or R G B), whatever the memory layout.
template <class Byte>
struct BasicImageView {
  PixelFormat format = PixelFormat::kGrey8;
  int width = 0;
  int height = 0;
  std::array<BasicPlaneView<Byte>, kMaxPlanes> planes{};
  std::size_t bytes = 0;  ///< size of the whole picture in memory; for kMjpeg the JPEG's length
  ColourCoding coding = {};
};
using ImageView = BasicImageView<const std::uint8_t>;
using MutableImageView = BasicImageView<std::uint8_t>;

/// YUYV, UYVY and I422 with every second chroma row left out: chroma row k is that of picture row 2 k, so chroma has
/// half the width and height, as in a raymap. Other formats are returned unchanged.
ImageView halved_chroma(ImageView picture);
/// The position of component c's samples in halved_chroma(). `all_rows` is the position of the samples of all rows.
PlaneGrid halved_chroma_grid(PixelFormat format, int c, PlaneGrid all_rows);

/// A view of the picture that starts at `data`, packed without padding (also between rows). For odd sizes chroma is
/// rounded up. Reads no memory. Not for kMjpeg.
ImageView packed_image(PixelFormat format, int width, int height, const std::uint8_t* data);
MutableImageView packed_image(PixelFormat format, int width, int height, std::uint8_t* data);

}  // namespace nodal
