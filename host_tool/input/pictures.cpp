#include "host_tool/input/pictures.h"

#include <algorithm>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/image_file.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "stitch/parallel/workers.h"

namespace nodal::host {

namespace {

/// A file's picture with its own numbers; with 16 bits a sample if it has them.
Result<DecodedImage> decode_as_stored(const std::string& file) {
  const bool tiff = media::is_tiff(file);
  NODAL_TRY_ASSIGN(const ImageHeader header, tiff ? media::read_tiff_header(file) : media::read_image_header(file));
  NODAL_TRY_ASSIGN(DecodedImage picture,
                   tiff ? media::read_tiff(file, header.deep) : media::read_image(file, header.deep));
  const SampleMeaning& said = picture.meaning;
  if (said.icc.empty() && said.curve == SampleMeaning::Curve::kUnsaid && media::exif_of(picture.metadata).adobe_rgb) {
    picture.meaning = media::adobe_rgb();
  }
  return picture;
}

Result<DecodedImage> as_srgb(DecodedImage&& picture, const std::string& file) {
  if (has_chroma(picture.format) && media::needs_conversion(picture.meaning)) {
    picture = in_format(std::move(picture), PixelFormat::kRgb24);
  }
  NODAL_TRY(media::in_srgb(picture, file));
  return std::move(picture);
}

}  // namespace

DecodedImage in_format(DecodedImage picture, PixelFormat format) {
  if (picture.format == format) return picture;
  DecodedImage made = media::convert_image(picture.view(), format);
  made.meaning = std::move(picture.meaning);
  made.metadata = std::move(picture.metadata);
  return made;
}

Result<DecodedImage> read_deep_picture(const std::string& file) {
  NODAL_TRY_ASSIGN(DecodedImage stored, decode_as_stored(file));
  const bool coded = has_chroma(stored.format);
  return as_srgb(coded ? in_format(std::move(stored), PixelFormat::kRgb24) : std::move(stored), file);
}

Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as, bool of_linear_head) {
  NODAL_TRY_ASSIGN(DecodedImage stored, decode_as_stored(file));
  if (of_linear_head && stored.meaning.is_linear()) stored.meaning.curve = SampleMeaning::Curve::kUnsaid;
  Result<DecodedImage> picture = as_srgb(std::move(stored), file);
  if (!picture) return picture;
  if (is_linear16(picture->format)) picture = media::shown_in_8_bits(*picture);
  if (as) picture = in_format(std::move(*picture), *as);
  return picture;
}

std::vector<bool> linear_heads(const Calibration& calibration) {
  std::vector<bool> linear;
  for (const HeadCalibration& head : calibration.heads) {
    linear.push_back(head.response.curve == Response::Curve::kLinear);
  }
  return linear;
}

Result<std::vector<DecodedImage>> read_all(const std::vector<std::string>& files,
                                           const std::function<void(std::size_t n)>& begin,
                                           const std::vector<bool>& of_linear_heads) {
  const parallel::Workers workers(0);
  std::vector<DecodedImage> images;
  while (images.size() < files.size()) {
    begin(images.size());
    const std::size_t at_once = std::min(files.size() - images.size(), static_cast<std::size_t>(workers.threads()));
    std::vector<std::optional<Result<DecodedImage>>> read(at_once);
    workers.run(static_cast<int>(at_once), [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      const std::size_t n = images.size() + k;
      read[k] = read_picture(files[n], std::nullopt, n < of_linear_heads.size() && of_linear_heads[n]);
    });
    for (std::optional<Result<DecodedImage>>& one : read) {
      if (!*one) return fail(one->error());
      images.push_back(std::move(**one));
    }
  }
  return images;
}

Result<ImageHeader> read_picture_header(const std::string& file) {
  return media::is_tiff(file) ? media::read_tiff_header(file) : media::read_image_header(file);
}

}  // namespace nodal::host
