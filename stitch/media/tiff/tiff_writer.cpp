#include "stitch/media/tiff/tiff_writer.h"

#include <cstring>

#include "stitch/media/tiff/exif_block.h"
#include "stitch/media/tiff/memory.h"

namespace nodal::media {
namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{4000} << 20;  // limit of the samples: offsets in a TIFF have 32 bits
constexpr int kEffort = 3;  // zlib's level, as in PNGs: a third of the time of the default 6, for 5 % more bytes
constexpr std::uint32_t kStripRows = 32;

bool write(TIFF* tiff, const ImageView& picture, const TiffNotes& notes) {
  const int channels = component_count(picture.format);
  const bool deep = is_linear16(picture.format);
  bool good = true;
  const auto set = [&](std::uint32_t tag, auto... values) { good = good && TIFFSetField(tiff, tag, values...) == 1; };
  set(TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(picture.width));
  set(TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(picture.height));
  set(TIFFTAG_SAMPLESPERPIXEL, channels);
  set(TIFFTAG_BITSPERSAMPLE, deep ? 16 : 8);
  set(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
  set(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  set(TIFFTAG_PHOTOMETRIC, channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  set(TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
  set(TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
  set(TIFFTAG_ZIPQUALITY, kEffort);
  set(TIFFTAG_ROWSPERSTRIP, kStripRows);
  if (!notes.description.empty()) set(TIFFTAG_IMAGEDESCRIPTION, notes.description.c_str());
  if (!notes.xmp.empty()) set(TIFFTAG_XMLPACKET, static_cast<std::uint32_t>(notes.xmp.size()), notes.xmp.data());
  if (!notes.icc.empty()) set(TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(notes.icc.size()), notes.icc.data());
  const PlaneView& first = picture.planes[0];
  std::vector<std::uint8_t> row(static_cast<std::size_t>(first.row_stride));  // libtiff overwrites it with differences
  for (int y = 0; good && y < picture.height; ++y) {
    std::memcpy(row.data(), first.data + y * first.row_stride, row.size());
    good = TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y), 0) == 1;
  }
  return good && TIFFFlush(tiff) == 1;
}

}  // namespace

Result<std::vector<std::uint8_t>> tiff_file(const ImageView& picture, const TiffNotes& notes) {
  const PixelFormat narrow = in_8_bits(picture.format);
  if (narrow != PixelFormat::kGrey8 && narrow != PixelFormat::kRgb24) {
    return fail(Errc::kUnsupported, "a TIFF of " + std::string(pixel_format_name(picture.format)) + " pictures");
  }
  if (packed_size(picture.format, picture.width, picture.height) > kMaxBytes) {
    return fail(Errc::kTooLarge, "a TIFF holds at most 4 GB; choose a smaller picture, or PNG");
  }
  TiffMemory memory;
  {
    const TiffPtr tiff = open_tiff(memory, "w");
    if (!tiff || !write(tiff.get(), picture, notes)) {
      return fail(Errc::kInternal, "libtiff could not write the picture: " + memory.why);
    }
  }
  add_exif(memory.bytes, notes.exif);
  return std::move(memory.bytes);
}

}  // namespace nodal::media
