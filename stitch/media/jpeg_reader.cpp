#include "stitch/media/jpeg_reader.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <memory>

#include "protocol/base/try.h"
#include "stitch/media/jpeg_segments.h"

namespace nodal::media {

namespace {

struct Close {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using Decoder = std::unique_ptr<void, Close>;

/// If data are truncated or corrupt, libjpeg only warns and fills with grey; here that is an error. TJFLAG_LIMITSCANS:
/// every scan of a progressive JPEG costs time for every pixel, so at most 500 scans are decoded.
constexpr int kFlags = TJFLAG_STOPONWARNING | TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS;

/// Whether the last bytes contain an end marker; files may have padding after it.
bool has_end(std::span<const std::uint8_t> bytes) {
  constexpr std::array<std::uint8_t, 2> kEnd{0xFF, 0xD9};
  const auto tail = bytes.last(std::min<std::size_t>(bytes.size(), 4096));
  return std::search(tail.begin(), tail.end(), kEnd.begin(), kEnd.end()) != tail.end();
}

Error broken(void* decoder, std::span<const std::uint8_t> bytes, const std::string& name) {
  const std::string why = tjGetErrorStr2(decoder);
  const bool early = !has_end(bytes);
  return {early ? Errc::kTruncated : Errc::kBadFormat,
          "picture '" + name + "': " + (early ? "the JPEG ends early" : "the JPEG is broken") + " (" + why +
              "); fetch or export it again"};
}

struct Header {
  ImageHeader image;
  int subsampling = 0;
  int colours = 0;
};

Result<Header> header(void* decoder, std::span<const std::uint8_t> bytes, const std::string& name) {
  constexpr int kUnnamed = -1;  // sampling factors that TurboJPEG has no name for; it decodes such files all the same
  Header h;
  if (tjDecompressHeader3(decoder, bytes.data(), bytes.size(), &h.image.width, &h.image.height, &h.subsampling,
                          &h.colours) != 0 &&
      h.subsampling != kUnnamed) {
    return fail(broken(decoder, bytes, name));
  }
  if (h.image.width <= 0 || h.image.height <= 0) {  // the data end before the picture's size, with no error
    return fail(Errc::kTruncated, "picture '" + name + "': the JPEG ends in its header; fetch or export it again");
  }
  if (h.colours == TJCS_CMYK || h.colours == TJCS_YCCK) {
    return fail(Errc::kUnsupported, "picture '" + name + "': the JPEG is for print (CMYK); save it as RGB");
  }
  if (h.colours == TJCS_GRAY) {
    h.image.natural = PixelFormat::kGrey8;
  } else if (h.colours == TJCS_YCbCr && h.subsampling == TJSAMP_420 && h.image.width % 2 == 0 &&
             h.image.height % 2 == 0) {
    // Not of odd sizes: TurboJPEG writes a row and a column of luma more than they have.
    h.image.natural = PixelFormat::kI420;
  }
  return h;
}

}  // namespace

Result<ImageHeader> jpeg_header(std::span<const std::uint8_t> bytes, const std::string& name) {
  const Decoder decoder(tjInitDecompress());
  NODAL_TRY_ASSIGN(auto h, header(decoder.get(), bytes, name));
  read_segments(bytes, h.image.meaning, h.image.metadata);
  return std::move(h.image);
}

Result<DecodedImage> decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name, bool rgb) {
  const Decoder decoder(tjInitDecompress());
  NODAL_TRY_ASSIGN(auto h, header(decoder.get(), bytes, name));
  const PixelFormat natural = h.image.natural;
  DecodedImage image{
      rgb && natural == PixelFormat::kI420 ? PixelFormat::kRgb24 : natural, h.image.width, h.image.height, {}};
  image.bytes.resize(packed_size(image.format, image.width, image.height));
  int status = 0;
  if (image.format == PixelFormat::kI420) {
    const MutableImageView view = packed_image(image.format, image.width, image.height, image.bytes.data());
    unsigned char* planes[3];
    int strides[3];
    for (std::size_t c = 0; c < 3; ++c) {
      planes[c] = view.planes[c].data;
      strides[c] = static_cast<int>(view.planes[c].row_stride);
    }
    status = tjDecompressToYUVPlanes(decoder.get(), bytes.data(), bytes.size(), planes, image.width, strides,
                                     image.height, kFlags);
  } else {
    status = tjDecompress2(decoder.get(), bytes.data(), bytes.size(), image.bytes.data(), image.width, 0, image.height,
                           image.format == PixelFormat::kGrey8 ? TJPF_GRAY : TJPF_RGB, kFlags);
  }
  if (status != 0) return fail(broken(decoder.get(), bytes, name));
  read_segments(bytes, image.meaning, image.metadata);
  return image;
}

Result<DecodedImage> decode_jpeg_eighth(std::span<const std::uint8_t> bytes, const std::string& name) {
  const Decoder decoder(tjInitDecompress());
  NODAL_TRY_ASSIGN(const auto h, header(decoder.get(), bytes, name));
  const bool grey = h.image.natural == PixelFormat::kGrey8;
  DecodedImage image{
      grey ? PixelFormat::kGrey8 : PixelFormat::kRgb24, (h.image.width + 7) / 8, (h.image.height + 7) / 8, {}};
  image.bytes.resize(packed_size(image.format, image.width, image.height));
  if (tjDecompress2(decoder.get(), bytes.data(), bytes.size(), image.bytes.data(), image.width, 0, image.height,
                    grey ? TJPF_GRAY : TJPF_RGB, kFlags) != 0) {
    return fail(broken(decoder.get(), bytes, name));
  }
  return image;
}

}  // namespace nodal::media
