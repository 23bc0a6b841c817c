#include "stitch/media/exif/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

namespace nodal::media {
namespace {

constexpr double kMinMm = 1, kMaxMm = 2000;

struct Unref {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};

/// The first number of a tag, of whatever kind it is.
std::optional<double> number(ExifData* data, ExifIfd ifd, ExifTag tag) {
  const ExifEntry* entry = exif_content_get_entry(data->ifd[ifd], tag);
  if (entry == nullptr || entry->data == nullptr || entry->components < 1) return std::nullopt;
  if (entry->size < exif_format_get_size(entry->format)) return std::nullopt;
  const ExifByteOrder order = exif_data_get_byte_order(data);
  switch (entry->format) {
    case EXIF_FORMAT_SHORT: return exif_get_short(entry->data, order);
    case EXIF_FORMAT_LONG: return exif_get_long(entry->data, order);
    case EXIF_FORMAT_RATIONAL: {
      const ExifRational value = exif_get_rational(entry->data, order);
      if (value.denominator == 0) return std::nullopt;
      return static_cast<double>(value.numerator) / value.denominator;
    }
    default: return std::nullopt;
  }
}

/// From the distance of pixels on the sensor.
std::optional<double> from_focal_plane(ExifData* data) {
  const auto focal_mm = number(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH);
  const auto per_unit = number(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  const auto width = number(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_X_DIMENSION);
  const auto height = number(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_Y_DIMENSION);
  if (!focal_mm || !per_unit || !width || !height) return std::nullopt;
  const double unit = number(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT).value_or(2);
  const double unit_mm = unit == 3 ? 10 : 25.4;
  const double focal_px = *focal_mm * *per_unit / unit_mm;
  return focal_px / std::hypot(*width, *height) * kFilmDiagonalMm;
}

/// The Interoperability index, three letters and a zero.
bool is_r03(ExifData* data) {
  const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_INTEROPERABILITY],
                                                  static_cast<ExifTag>(EXIF_TAG_INTEROPERABILITY_INDEX));
  return entry != nullptr && entry->data != nullptr && entry->size >= 3 && std::memcmp(entry->data, "R03", 3) == 0;
}

}  // namespace

std::array<double, 2> up_of(int orientation) {
  switch (orientation) {
    case 3:
    case 4: return {0, 1};
    case 5:
    case 6: return {-1, 0};
    case 7:
    case 8: return {1, 0};
    default: return {0, -1};
  }
}

bool is_outdated(int orientation, int width, int height) { return orientation >= 5 && width < height; }

SampleMeaning adobe_rgb() {
  SampleMeaning meaning;
  meaning.curve = SampleMeaning::Curve::kGamma;
  meaning.gamma = 563.0 / 256;
  meaning.primaries = {0.3127, 0.3290, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06};
  return meaning;
}

Exif parse_exif(std::span<const std::uint8_t> start) {
  Exif exif;
  const std::unique_ptr<ExifData, Unref> data(
      exif_data_new_from_data(start.data(), static_cast<unsigned int>(std::min(start.size(), kExifBytes))));
  if (!data) return exif;
  const auto plausible = [](std::optional<double> mm) { return mm && *mm >= kMinMm && *mm <= kMaxMm; };
  // 0 means that it is not known.
  exif.focal_35mm = number(data.get(), EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (!plausible(exif.focal_35mm)) exif.focal_35mm = from_focal_plane(data.get());
  if (!plausible(exif.focal_35mm)) exif.focal_35mm.reset();
  const double turned = number(data.get(), EXIF_IFD_0, EXIF_TAG_ORIENTATION).value_or(1);
  if (turned >= 1 && turned <= 8) exif.orientation = static_cast<int>(turned);
  constexpr double kAdobeOfSome = 2;  // not in the standard, but written
  exif.adobe_rgb = is_r03(data.get()) || number(data.get(), EXIF_IFD_EXIF, EXIF_TAG_COLOR_SPACE) == kAdobeOfSome;
  return exif;
}

Exif exif_of(const FileMetadata& metadata) {
  if (metadata.exif.empty()) return {};
  std::vector<std::uint8_t> block{'E', 'x', 'i', 'f', 0, 0};
  block.insert(block.end(), metadata.exif.begin(), metadata.exif.end());
  return parse_exif(block);
}

}  // namespace nodal::media
