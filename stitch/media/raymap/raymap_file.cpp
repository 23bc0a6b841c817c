#include "stitch/media/raymap/raymap_file.h"

#include <fmt/format.h>

#include <optional>
#include <utility>

#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/gpano.h"
#include "stitch/media/image_file.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/linear_words.h"
#include "stitch/media/png_writer.h"
#include "stitch/media/tiff/tiff_writer.h"

namespace nodal::media {
namespace {

/// zlib's level for raymaps as PNG: a third of the time of the default 6, for 5 % more bytes.
constexpr int kPngEffort = 3;

Result<std::vector<std::uint8_t>> encode_jpeg(const DecodedImage& picture, const RaymapFile& file,
                                              const std::string& xmp) {
  if (is_linear16(picture.format)) return encode_jpeg(shown_in_8_bits(picture), file, xmp);
  JpegWriter writer({picture.format, picture.width, picture.height, file.quality, xmp, std::nullopt, file.kept.exif});
  std::vector<std::uint8_t> jpeg;
  NODAL_TRY(writer.write(picture.view(), file.comment, jpeg));
  return jpeg;
}

}  // namespace

Result<RaymapFormat> parse_raymap_format(std::string_view text) {
  if (text == "jpg") return RaymapFormat::kJpg;
  if (text == "png") return RaymapFormat::kPng;
  if (text == "tif") return RaymapFormat::kTiff;
  if (text == "raw") return RaymapFormat::kRaw;
  return fail(Errc::kBadValue, fmt::format("format '{}': it is jpg, png, tif or raw", text));
}

Result<RaymapFormat> raymap_format_of_name(std::string_view name) {
  if (has_ending(name, ".jpg") || has_ending(name, ".jpeg")) return RaymapFormat::kJpg;
  if (has_ending(name, ".png")) return RaymapFormat::kPng;
  if (has_ending(name, ".tif") || has_ending(name, ".tiff")) return RaymapFormat::kTiff;
  if (has_ending(name, ".raw") || has_ending(name, ".yuv")) return RaymapFormat::kRaw;
  return fail(Errc::kBadValue, fmt::format("'{}': end it in .jpg, .png, .tif or .raw", name));
}

std::string_view ending_of(RaymapFormat format) {
  switch (format) {
    case RaymapFormat::kJpg: return "jpg";
    case RaymapFormat::kPng: return "png";
    case RaymapFormat::kTiff: return "tif";
    case RaymapFormat::kRaw: break;
  }
  return "raw";
}

Result<std::vector<std::uint8_t>> encode(const DecodedImage& picture, const RaymapFile& file) {
  if (file.format == RaymapFormat::kRaw) return picture.bytes;
  const std::string xmp = file.area ? gpano_packet(*file.area, file.kept.properties)
                                    : raymap_packet(file.layout, picture.width, picture.height, file.kept.properties);
  if (file.format == RaymapFormat::kJpg) return encode_jpeg(picture, file, xmp);
  DecodedImage rgb;
  const DecodedImage* written = &picture;
  if (has_chroma(picture.format)) {
    rgb = convert_image(picture.view(), PixelFormat::kRgb24);
    rgb.meaning = picture.meaning;
    written = &rgb;
  }
  const SampleMeaning& meaning = written->meaning;
  const bool deep = is_linear16(written->format);
  const int channels = component_count(written->format);
  if (file.format == RaymapFormat::kTiff) {
    TiffNotes notes{linear_comment(meaning), xmp};
    notes.exif = file.kept.exif;
    if (meaning.is_linear()) notes.icc = linear_profile(channels == 1);
    return tiff_file(written->view(), notes);
  }
  PngNotes notes;
  notes.effort = kPngEffort;
  notes.xmp = xmp;
  notes.exif = file.kept.exif;
  notes.comment = linear_comment(meaning);
  notes.meaning = meaning;
  return png_file({written->width, written->height, channels, deep ? 16 : 8, written->bytes}, notes);
}

Result<std::vector<std::uint8_t>> encode(const Raymap& raymap, RaymapFormat format) {
  const RaymapMeta& meta = raymap.meta;
  const std::optional<PixelFormat> pixels = raw_format(meta);
  if (!pixels) return fail(Errc::kUnsupported, fmt::format("a raymap of coding '{}'", meta.coding));
  DecodedImage image{*pixels, meta.width, meta.height, raymap.bytes};
  if (is_linear16(*pixels)) image.meaning = SampleMeaning::linear();
  if (meta.full_exposure_ns) image.meaning.full_exposure_ns = meta.full_exposure_ns;
  RaymapFile file;
  file.format = format;
  file.layout = meta.layout;
  auto encoded = encode(image, file);
  if (!encoded) return fail(encoded.error().in(ending_of(format)));
  return encoded;
}

}  // namespace nodal::media
