#include "stitch/media/exif/place_and_time.h"

#include <fmt/format.h>

#include <libexif/exif-data.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>

namespace nodal::media {
namespace {

constexpr std::size_t kMaxTagBytes = 1024;
constexpr std::array kBegin{'E', 'x', 'i', 'f', '\0', '\0'};

struct UnrefData {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};
using Data = std::unique_ptr<ExifData, UnrefData>;

struct KeptTag {
  ExifIfd ifd;
  int tag;
};
constexpr int kOffsetTime = 0x9010, kOffsetTimeOriginal = 0x9011, kOffsetTimeDigitized = 0x9012;
constexpr std::array kKeptTags{KeptTag{EXIF_IFD_0, EXIF_TAG_MAKE},
                               KeptTag{EXIF_IFD_0, EXIF_TAG_MODEL},
                               KeptTag{EXIF_IFD_0, EXIF_TAG_DATE_TIME},
                               KeptTag{EXIF_IFD_EXIF, EXIF_TAG_DATE_TIME_ORIGINAL},
                               KeptTag{EXIF_IFD_EXIF, EXIF_TAG_DATE_TIME_DIGITIZED},
                               KeptTag{EXIF_IFD_EXIF, EXIF_TAG_SUB_SEC_TIME_ORIGINAL},
                               KeptTag{EXIF_IFD_EXIF, kOffsetTime},
                               KeptTag{EXIF_IFD_EXIF, kOffsetTimeOriginal},
                               KeptTag{EXIF_IFD_EXIF, kOffsetTimeDigitized}};

/// What a GPS tag says of the direction of the camera or of its movement: GPSSpeedRef (12) to GPSDestDistance (26).
bool is_direction(int tag) { return tag >= 12 && tag <= 26; }

void copy(ExifData* to, ExifIfd ifd, const ExifEntry* entry) {
  if (entry->data == nullptr || entry->size == 0 || entry->size > kMaxTagBytes) return;
  ExifEntry* made = exif_entry_new();
  made->tag = entry->tag;
  made->format = entry->format;
  made->components = entry->components;
  made->size = entry->size;
  made->data = static_cast<unsigned char*>(std::malloc(entry->size));  // libexif frees it
  if (made->data != nullptr) {
    std::memcpy(made->data, entry->data, entry->size);
    exif_content_add_entry(to->ifd[ifd], made);
  }
  exif_entry_unref(made);
}

std::string text_of(ExifData* data, ExifIfd ifd, int tag) {
  const ExifEntry* entry = exif_content_get_entry(data->ifd[ifd], static_cast<ExifTag>(tag));
  if (entry == nullptr || entry->data == nullptr || entry->format != EXIF_FORMAT_ASCII) return {};
  const std::string text(reinterpret_cast<const char*>(entry->data), entry->size);
  return text.substr(0, text.find('\0'));
}

/// "2024:05:06 07:08:09" as XMP writes it, with the offset from UTC if it is known; empty if it is no date.
std::string date_of(ExifData* data, int tag, int offset_tag) {
  const std::string text = text_of(data, EXIF_IFD_EXIF, tag);
  constexpr std::string_view kShape = "0000:00:00 00:00:00";
  const auto fits = [](char is, char shape) { return shape == '0' ? is >= '0' && is <= '9' : is == shape; };
  if (text.size() != kShape.size() || !std::equal(text.begin(), text.end(), kShape.begin(), fits)) return {};
  const std::string offset = text_of(data, EXIF_IFD_EXIF, offset_tag);
  const bool known = offset.size() == 6 && (offset[0] == '+' || offset[0] == '-');
  return text.substr(0, 4) + "-" + text.substr(5, 2) + "-" + text.substr(8, 2) + "T" + text.substr(11) +
         (known ? offset : "");
}

std::optional<double> rational(ExifData* data, int tag, unsigned number) {
  const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(tag));
  if (entry == nullptr || entry->data == nullptr || entry->format != EXIF_FORMAT_RATIONAL ||
      entry->components <= number || entry->size < 8 * (number + 1)) {
    return std::nullopt;
  }
  const ExifRational value = exif_get_rational(entry->data + 8 * number, exif_data_get_byte_order(data));
  if (value.denominator == 0) return std::nullopt;
  return static_cast<double>(value.numerator) / value.denominator;
}

/// Degrees, minutes and seconds as XMP's "52,30.123456N".
std::string coordinate(ExifData* data, int tag, int side_tag, const std::string& sides) {
  const std::optional<double> degrees = rational(data, tag, 0);
  const std::string side = text_of(data, EXIF_IFD_GPS, side_tag);
  if (!degrees || side.size() != 1 || sides.find(side) == std::string::npos) return {};
  const double minutes = 60 * *degrees + rational(data, tag, 1).value_or(0) + rational(data, tag, 2).value_or(0) / 60;
  if (!(minutes >= 0 && minutes <= 180 * 60)) return {};
  const int whole = static_cast<int>(minutes / 60);
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%d,%.6f%s", whole, minutes - 60 * whole, side.c_str());
  return text.data();
}

void add_properties(ExifData* data, PlaceAndTime& known) {
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) known.properties.emplace_back(name, value);
  };
  add("exif:DateTimeOriginal", date_of(data, EXIF_TAG_DATE_TIME_ORIGINAL, kOffsetTimeOriginal));
  add("exif:DateTimeDigitized", date_of(data, EXIF_TAG_DATE_TIME_DIGITIZED, kOffsetTimeDigitized));
  const std::string latitude = coordinate(data, EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, "NS");
  const std::string longitude = coordinate(data, EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, "EW");
  if (latitude.empty() || longitude.empty()) return;
  add("exif:GPSLatitude", latitude);
  add("exif:GPSLongitude", longitude);
  const std::optional<double> altitude = rational(data, EXIF_TAG_GPS_ALTITUDE, 0);
  if (!altitude) return;
  const ExifEntry* below =
      exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(EXIF_TAG_GPS_ALTITUDE_REF));
  add("exif:GPSAltitude", fmt::format("{}/1000", std::llround(*altitude * 1000)));
  add("exif:GPSAltitudeRef",
      below != nullptr && below->data != nullptr && below->size > 0 && below->data[0] == 1 ? "1" : "0");
}

}  // namespace

PlaceAndTime place_and_time(const FileMetadata& metadata, bool direction) {
  if (metadata.exif.empty()) return {};
  std::vector<std::uint8_t> block(kBegin.begin(), kBegin.end());
  block.insert(block.end(), metadata.exif.begin(), metadata.exif.end());
  const Data from(exif_data_new_from_data(block.data(), static_cast<unsigned int>(block.size())));
  const Data made(exif_data_new());
  if (!from || !made) return {};
  exif_data_set_byte_order(made.get(), exif_data_get_byte_order(from.get()));
  for (const KeptTag& kept : kKeptTags) {
    const ExifEntry* entry = exif_content_get_entry(from->ifd[kept.ifd], static_cast<ExifTag>(kept.tag));
    if (entry != nullptr) copy(made.get(), kept.ifd, entry);
  }
  const ExifContent* gps = from->ifd[EXIF_IFD_GPS];
  for (unsigned int k = 0; k < gps->count; ++k) {
    if (direction || !is_direction(gps->entries[k]->tag)) copy(made.get(), EXIF_IFD_GPS, gps->entries[k]);
  }
  PlaceAndTime known;
  add_properties(made.get(), known);
  if (std::ranges::all_of(made->ifd, [](const ExifContent* ifd) { return ifd->count == 0; })) return known;
  unsigned char* bytes = nullptr;
  unsigned int length = 0;
  exif_data_save_data(made.get(), &bytes, &length);
  if (bytes != nullptr && length > kBegin.size()) known.exif.assign(bytes + kBegin.size(), bytes + length);
  std::free(bytes);
  return known;
}

}  // namespace nodal::media
