#include "stitch/media/jpeg_writer.h"

#include <turbojpeg.h>

#include <array>
#include <initializer_list>
#include <string>

#include "protocol/base/try.h"

namespace nodal::media {
namespace {

constexpr std::string_view kXmpName("http://ns.adobe.com/xap/1.0/\0", 29);
constexpr std::string_view kExifName("Exif\0\0", 6);
constexpr std::uint8_t kApp0 = 0xe0, kApp1 = 0xe1, kComment = 0xfe;

int subsampling(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey8: return TJSAMP_GRAY;
    case PixelFormat::kI420:
    case PixelFormat::kNv12: return TJSAMP_420;
    case PixelFormat::kI422:
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: return TJSAMP_422;
    case PixelFormat::kYuv411: return TJSAMP_411;
    default: return TJSAMP_444;
  }
}

bool is_interleaved(PixelFormat format) {
  return format == PixelFormat::kNv12 || format == PixelFormat::kYuyv || format == PixelFormat::kUyvy ||
         format == PixelFormat::kYuv411;
}

/// The components of a kYuv411 picture, each in a plane of its own in `out`, which has the picture's bytes. Rows are
/// whole groups of 4 pixels, which TurboJPEG reads, too, where the width is not a multiple of 4.
ImageView apart_411(const ImageView& picture, std::uint8_t* out) {
  constexpr std::array<std::ptrdiff_t, 4> kLuma{1, 2, 4, 5};  ///< places in a group
  const int groups = yuv411_row_bytes(picture.width) / 6;
  ImageView apart = picture;
  for (std::size_t c = 0; c < 3; ++c) {
    const int width = c == 0 ? 4 * groups : groups;
    apart.planes[c] = {out, width, picture.height, width, 1};
    for (int y = 0; y < picture.height; ++y) {
      const std::uint8_t* const row = picture.planes[0].data + y * picture.planes[0].row_stride;
      for (int x = 0; x < width; ++x) {
        *out++ = c == 0 ? row[6 * (x / 4) + kLuma[static_cast<std::size_t>(x % 4)]] : row[6 * x + (c == 1 ? 0 : 3)];
      }
    }
  }
  return apart;
}

/// AVI1, the field (1: odd, which is the top field; 2: even), a zero, and two lengths, which readers do not need.
std::string avi1(FieldParity parity) {
  std::string body("AVI1\0\0\0\0\0\0\0\0\0\0", 14);
  body[4] = parity == FieldParity::kTop ? 1 : 2;
  return body;
}

/// A JPEG segment: marker, length (including its own two bytes), body (ITU T.81, B.1.1.4).
void append_segment(std::vector<std::uint8_t>& to, std::uint8_t marker, std::initializer_list<std::string_view> body) {
  std::size_t length = 2;
  for (const std::string_view part : body) length += part.size();
  NODAL_ASSERT(length <= 0xffff);
  to.insert(to.end(), {0xff, marker, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)});
  for (const std::string_view part : body) to.insert(to.end(), part.begin(), part.end());
}

/// The number of bytes of SOI and, if present, JFIF's APP0, which must come first.
std::size_t lead_bytes(const std::uint8_t* jpeg, std::size_t size) {
  if (size < 6 || jpeg[2] != 0xff || jpeg[3] != kApp0) return 2;
  const std::size_t end = 4 + (static_cast<std::size_t>(jpeg[4]) << 8 | jpeg[5]);
  return end <= size ? end : 2;
}

}  // namespace

JpegWriter::JpegWriter(const JpegSpec& spec)
    : format_(spec.format),
      width_(spec.width),
      height_(spec.height),
      quality_(spec.quality),
      field_(spec.field),
      handle_(tjInitCompress()),
      scratch_bytes_(tjBufSize(spec.width, spec.height, subsampling(spec.format))) {
  NODAL_ASSERT(handle_);
  NODAL_ASSERT(writes(format_));
  if (is_interleaved(format_)) planes_.resize(packed_size(format_, width_, height_));
  scratch_ = std::make_unique_for_overwrite<std::uint8_t[]>(scratch_bytes_);
  const std::string_view exif(reinterpret_cast<const char*>(spec.exif.data()), spec.exif.size());
  if (!exif.empty()) append_segment(metadata_, kApp1, {kExifName, exif});
  if (!spec.xmp.empty()) append_segment(metadata_, kApp1, {kXmpName, spec.xmp});
}

JpegWriter::~JpegWriter() { tjDestroy(handle_); }

bool JpegWriter::writes(PixelFormat format) {
  return has_chroma(format) || format == PixelFormat::kGrey8 || format == PixelFormat::kRgb24;
}

ImageView JpegWriter::with_planes(const ImageView& picture) {
  if (!is_interleaved(format_)) return picture;
  if (format_ == PixelFormat::kYuv411) return apart_411(picture, planes_.data());
  ImageView apart = picture;
  std::uint8_t* out = planes_.data();
  for (std::size_t c = 0; c < 3; ++c) {
    const PlaneView& from = picture.planes[c];
    if (from.pixel_stride == 1) continue;
    apart.planes[c] = {out, from.width, from.height, from.width, 1};
    for (int y = 0; y < from.height; ++y) {
      const std::uint8_t* in = from.data + y * from.row_stride;
      for (int x = 0; x < from.width; ++x, in += from.pixel_stride) *out++ = *in;
    }
  }
  return apart;
}

Result<std::size_t> JpegWriter::compress(const ImageView& picture) {
  unsigned char* out = scratch_.get();
  unsigned long size = scratch_bytes_;
  constexpr int kFlags = TJFLAG_NOREALLOC;
  int failed = 0;
  if (format_ == PixelFormat::kRgb24) {
    failed = tjCompress2(handle_, picture.planes[0].data, width_, static_cast<int>(picture.planes[0].row_stride),
                         height_, TJPF_RGB, &out, &size, TJSAMP_444, quality_, kFlags);
  } else {
    std::array<const unsigned char*, kMaxPlanes> planes{};
    std::array<int, kMaxPlanes> strides{};
    for (std::size_t c = 0; c < planes.size(); ++c) {
      planes[c] = picture.planes[c].data;
      strides[c] = static_cast<int>(picture.planes[c].row_stride);
    }
    failed = tjCompressFromYUVPlanes(handle_, planes.data(), width_, strides.data(), height_, subsampling(format_),
                                     &out, &size, quality_, kFlags);
  }
  if (failed != 0) return fail(Errc::kInternal, std::string("JPEG encoder: ") + tjGetErrorStr2(handle_));
  return static_cast<std::size_t>(size);
}

Status JpegWriter::write(const ImageView& picture, std::string_view comment, std::vector<std::uint8_t>& into) {
  NODAL_ASSERT(picture.format == format_ && picture.width == width_ && picture.height == height_);
  NODAL_TRY_ASSIGN(const auto size, compress(with_planes(picture)));
  const std::uint8_t* jpeg = scratch_.get();
  const std::size_t lead = lead_bytes(jpeg, size);
  into.assign(jpeg, jpeg + lead);
  if (field_) append_segment(into, kApp0, {avi1(*field_)});
  into.insert(into.end(), metadata_.begin(), metadata_.end());
  if (!comment.empty()) append_segment(into, kComment, {comment});
  into.insert(into.end(), jpeg + lead, jpeg + size);
  return {};
}

}  // namespace nodal::media
