#include "stitch/media/jpeg_segments.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

namespace nodal::media {
namespace {

constexpr std::string_view kXmpBegin("http://ns.adobe.com/xap/1.0/\0", 29);
constexpr std::string_view kExifBegin("Exif\0\0", 6);
constexpr std::string_view kIccBegin("ICC_PROFILE\0", 12);
constexpr std::uint8_t kApp1Marker = 0xE1, kApp2Marker = 0xE2, kScanMarker = 0xDA, kEndMarker = 0xD9;

/// The part of a profile in one segment.
struct IccPart {
  std::uint8_t number = 0;
  std::string_view bytes;
};

}  // namespace

void read_segments(std::span<const std::uint8_t> jpeg, SampleMeaning& meaning, FileMetadata& metadata) {
  std::vector<IccPart> profile;
  std::size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == 0xFF) {
    const std::uint8_t marker = jpeg[at + 1];
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    if (marker == kScanMarker || marker == kEndMarker) break;
    const std::size_t length = static_cast<std::size_t>(jpeg[at + 2]) << 8 | jpeg[at + 3];
    if (length < 2 || at + 2 + length > jpeg.size()) break;
    const std::string_view body(reinterpret_cast<const char*>(jpeg.data()) + at + 4, length - 2);
    at += 2 + length;
    if (marker == kApp1Marker && body.starts_with(kXmpBegin) && metadata.xmp.empty()) {
      metadata.xmp = body.substr(kXmpBegin.size());
    } else if (marker == kApp1Marker && body.starts_with(kExifBegin) && metadata.exif.empty()) {
      metadata.exif.assign(body.begin() + kExifBegin.size(), body.end());
    } else if (marker == kApp2Marker && body.starts_with(kIccBegin) && body.size() > kIccBegin.size() + 2) {
      profile.push_back({static_cast<std::uint8_t>(body[kIccBegin.size()]), body.substr(kIccBegin.size() + 2)});
    }
  }
  std::ranges::stable_sort(profile, {}, &IccPart::number);
  for (const IccPart& part : profile) {
    meaning.icc.insert(meaning.icc.end(), part.bytes.begin(), part.bytes.end());
  }
}

}  // namespace nodal::media
