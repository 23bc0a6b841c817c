#include "host_tool/commands/result_file.h"

#include <utility>

#include "protocol/base/try.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/gpano.h"
#include "stitch/media/image_file.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/media/linear_words.h"
#include "stitch/media/png_writer.h"
#include "stitch/media/tiff/tiff_writer.h"

namespace nodal::host {
namespace {

Result<std::vector<std::uint8_t>> encode_jpeg(const DecodedImage& picture, const ResultFile& file,
                                              const std::string& xmp) {
  if (is_linear16(picture.format)) return encode_jpeg(media::shown_in_8_bits(picture), file, xmp);
  media::JpegWriter writer(
      {picture.format, picture.width, picture.height, file.quality, xmp, std::nullopt, file.kept.exif});
  std::vector<std::uint8_t> jpeg;
  NODAL_TRY(writer.write(picture.view(), file.comment, jpeg));
  return jpeg;
}

}  // namespace

Result<std::vector<std::uint8_t>> encode_result(const DecodedImage& picture, const ResultFile& file) {
  if (file.format == RaymapFormat::kRaw) return picture.bytes;
  const std::string xmp = file.whole_sphere ? media::gpano_packet(picture.width, picture.height, file.kept.properties)
                                            : media::xmp_packet(file.kept.properties);
  if (file.format == RaymapFormat::kJpg) return encode_jpeg(picture, file, xmp);
  DecodedImage rgb;
  const DecodedImage* written = &picture;
  if (has_chroma(picture.format)) {
    rgb = media::convert_image(picture.view(), PixelFormat::kRgb24);
    rgb.meaning = picture.meaning;
    written = &rgb;
  }
  const SampleMeaning& meaning = written->meaning;
  const bool deep = is_linear16(written->format);
  const int channels = component_count(written->format);
  if (file.format == RaymapFormat::kTiff) {
    media::TiffNotes notes{media::linear_comment(meaning), xmp};
    notes.exif = file.kept.exif;
    if (meaning.is_linear()) notes.icc = media::linear_profile(channels == 1);
    return media::tiff_file(written->view(), notes);
  }
  media::PngNotes notes;
  notes.effort = kPngEffort;
  notes.xmp = xmp;
  notes.exif = file.kept.exif;
  notes.comment = media::linear_comment(meaning);
  notes.meaning = meaning;
  return media::png_file({written->width, written->height, channels, deep ? 16 : 8, written->bytes}, notes);
}

}  // namespace nodal::host
