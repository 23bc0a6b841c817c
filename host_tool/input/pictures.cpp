#include "host_tool/input/pictures.h"

#include <algorithm>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/heif_webp/reader.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "stitch/parallel/workers.h"

namespace nodal::host {

namespace {

/// A file's picture with its own numbers; with 16 bits a sample if it has them.
Result<DecodedImage> decode_as_stored(media::PictureBytes& file) {
  NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(file));
  NODAL_TRY_ASSIGN(DecodedImage picture, media::is_tiff(file)           ? media::decode_tiff(file, header.deep)
                                         : media::is_heif_or_webp(file) ? media::decode_heif_or_webp(file)
                                                                        : media::decode_image(file, header.deep));
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

/// In 8 bits.
Result<DecodedImage> shown(DecodedImage&& stored, bool of_linear_head, const std::string& file) {
  if (of_linear_head && stored.meaning.is_linear()) stored.meaning.curve = SampleMeaning::Curve::kUnsaid;
  NODAL_TRY_ASSIGN(DecodedImage picture, as_srgb(std::move(stored), file));
  if (is_linear16(picture.format)) picture = media::shown_in_8_bits(picture);
  return picture;
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
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  NODAL_TRY_ASSIGN(DecodedImage stored, decode_as_stored(bytes));
  const bool coded = has_chroma(stored.format);
  return as_srgb(coded ? in_format(std::move(stored), PixelFormat::kRgb24) : std::move(stored), file);
}

Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  NODAL_TRY_ASSIGN(DecodedImage stored, decode_as_stored(bytes));
  NODAL_TRY_ASSIGN(DecodedImage picture, shown(std::move(stored), false, file));
  if (as) picture = in_format(std::move(picture), *as);
  return picture;
}

Result<DecodedImage> picture_of(std::span<const std::uint8_t> bytes, const std::string& name) {
  NODAL_TRY_ASSIGN(DecodedImage stored, media::decode_image(bytes, name));
  return shown(std::move(stored), false, name);
}

Result<std::optional<DecodedImage>> read_opacity(const std::string& file) {
  NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
  return read_opacity(bytes);
}

Result<std::optional<DecodedImage>> read_opacity(media::PictureBytes& bytes) {
  const bool tiff = media::is_tiff(bytes);
  if (!tiff) {
    NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(bytes));
    if (!header.meaning.alpha) return std::nullopt;
  }
  NODAL_TRY_ASSIGN(DecodedImage opacity, tiff                            ? media::decode_tiff_opacity(bytes)
                                         : media::is_heif_or_webp(bytes) ? media::decode_heif_or_webp_opacity(bytes)
                                                                         : media::decode_opacity(bytes));
  if (std::ranges::all_of(opacity.bytes, [](std::uint8_t alpha) { return alpha == 255; })) return std::nullopt;
  return opacity;
}

Result<ImageHeader> read_picture_header(media::PictureBytes& file) {
  if (media::is_tiff(file)) return media::tiff_header(file);
  return media::is_heif_or_webp(file) ? media::heif_or_webp_header(file) : media::image_header(file);
}

std::vector<bool> linear_heads(const Calibration& calibration) {
  std::vector<bool> linear;
  for (const HeadCalibration& head : calibration.heads) {
    linear.push_back(head.response.curve == Response::Curve::kLinear);
  }
  return linear;
}

HeadPicture::HeadPicture(std::string file, std::shared_ptr<media::PictureBytes> opened)
    : file_(std::move(file)), opened_(std::move(opened)) {}

HeadPicture::HeadPicture(std::string file, PictureSplit split, std::size_t part)
    : file_(std::move(file)), split_(split), part_(part) {}

HeadPicture::HeadPicture(DecodedImage pixels) : pixels_(std::move(pixels)) {}

DecodedImage HeadPicture::own_part(const DecodedImage& whole) const {
  return split_.count() > 1 ? part_of(whole, split_, part_) : whole;
}

Result<std::shared_ptr<media::PictureBytes>> HeadPicture::open() const {
  if (opened_) return opened_;
  NODAL_TRY_ASSIGN(media::PictureBytes opened, media::PictureBytes::open(file_));
  return std::make_shared<media::PictureBytes>(std::move(opened));
}

Result<ImageHeader> HeadPicture::header() {
  if (pixels_) return ImageHeader{.width = pixels_->width, .height = pixels_->height, .natural = pixels_->format};
  NODAL_TRY_ASSIGN(opened_, open());
  return read_picture_header(*opened_);
}

Result<std::optional<DecodedImage>> HeadPicture::opacity() {
  if (opaque_ || file_.empty()) return std::nullopt;
  const bool decoded = pixels_.has_value();
  NODAL_TRY_ASSIGN(const std::shared_ptr<media::PictureBytes> bytes, open());
  if (!decoded) opened_ = bytes;
  return read_opacity(*bytes);
}

Status HeadPicture::decode(bool of_linear_head) {
  const bool same = !says_linear_ || of_linear_head == of_linear_head_;
  if (pixels_ && (same || file_.empty())) return {};
  pixels_.reset();
  NODAL_TRY_ASSIGN(std::shared_ptr<media::PictureBytes> bytes, open());
  opened_ = nullptr;
  const bool coded = media::is_heif_or_webp(*bytes);
  if (!coded && !media::is_tiff(*bytes)) {
    NODAL_TRY_ASSIGN(const auto start, bytes->first(media::kExifBytes));
    const media::Exif exif = media::parse_exif(start);
    focal_35mm_ = exif.focal_35mm;
    orientation_ = exif.orientation;
  }
  NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(*bytes));
  opaque_ = !media::is_tiff(*bytes) && !header.meaning.alpha;
  NODAL_TRY_ASSIGN(DecodedImage stored, decode_as_stored(*bytes));
  if (coded) {
    const media::Exif exif = media::exif_of(stored.metadata);
    focal_35mm_ = exif.focal_35mm;
    orientation_ = media::is_turned(*bytes) ? 1 : exif.orientation;
  }
  bytes.reset();
  if (split_.count() > 1) stored = part_of(stored, split_, part_);
  says_linear_ = stored.meaning.is_linear();
  of_linear_head_ = of_linear_head;
  NODAL_TRY_ASSIGN(DecodedImage picture, shown(std::move(stored), of_linear_head, file_));
  pixels_ = std::move(picture);
  return {};
}

DecodedImage HeadPicture::take() {
  DecodedImage taken = std::move(*pixels_);
  pixels_.reset();
  return taken;
}

void HeadPicture::release() {
  if (!file_.empty()) pixels_.reset();
}

Status decode_all(std::vector<HeadPicture>& pictures, const std::vector<bool>& of_linear_heads,
                  const std::function<void(std::size_t n)>& begin) {
  const parallel::Workers workers(0);
  const auto at_once = static_cast<std::size_t>(workers.threads());
  for (std::size_t from = 0; from < pictures.size(); from += at_once) {
    begin(from);
    std::vector<Status> done(std::min(pictures.size() - from, at_once));
    workers.run(static_cast<int>(done.size()), [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      const std::size_t n = from + k;
      done[k] = pictures[n].decode(n < of_linear_heads.size() && of_linear_heads[n]);
    });
    for (const Status& one : done) {
      NODAL_TRY(one);
    }
  }
  return {};
}

}  // namespace nodal::host
