#include "stitch/media/plain_image.h"

#include <string>
#include <string_view>

#include "protocol/base/try.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/srgb_profile.h"
#include "stitch/media/tiff_directory.h"

namespace nodal::media {
namespace {

bool is_adobe_rgb(const FileMetadata& metadata) {
  constexpr std::uint32_t kExif = 34665, kColourSpace = 40961, kInteroperability = 40965, kIndex = 1;
  constexpr std::uint32_t kAdobeOfSome = 2;  // not in the standard, but written
  const std::optional<TiffDirectory> exif = TiffDirectory(metadata.exif).linked(kExif);
  if (!exif) return false;
  if (exif->find(kColourSpace) == kAdobeOfSome) return true;
  const std::optional<TiffDirectory> interoperability = exif->linked(kInteroperability);
  const std::uint32_t r03 = exif->little_endian() ? 0x00333052 : 0x52303300;  // "R03" and a zero
  return interoperability && interoperability->find(kIndex) == r03;
}

/// What a file says of its numbers other than that they are sRGB's, and how to remove that.
struct Claim {
  std::string_view by, removal;
};
constexpr Claim kProfile{"its colour profile", "exiftool -icc_profile= FILE"};
constexpr Claim kChunks{"its cICP, gAMA or cHRM chunk", "convert FILE -define png:exclude-chunks=gAMA,cHRM FILE.png"};
constexpr Claim kExif{"its Exif (Adobe RGB)", "exiftool -interopindex= -exif:colorspace= FILE"};

const Claim* claim_of(const ImageHeader& header) {
  const SampleMeaning& meaning = header.meaning;
  if (!meaning.unread.empty()) return &kChunks;
  if (!meaning.icc.empty()) return is_srgb_profile(meaning.icc) ? nullptr : &kProfile;
  if (meaning.curve == SampleMeaning::Curve::kGamma || meaning.primaries) return &kChunks;
  return meaning.curve == SampleMeaning::Curve::kUnsaid && is_adobe_rgb(header.metadata) ? &kExif : nullptr;
}

}  // namespace

Status check_plain(const ImageHeader& header, const std::filesystem::path& file) {
  const Claim* claim = claim_of(header);
  if (claim == nullptr) return {};
  return fail(
      Errc::kUnsupported,
      "picture '" + file.string() + "': is not in sRGB, as " + std::string(claim->by) +
          " says, and its colours are not converted here; save it as sRGB, or, if its numbers are as the camera "
          "delivered them, remove what says otherwise: " +
          std::string(claim->removal));
}

Result<ImageHeader> read_plain_header(const std::filesystem::path& file) {
  NODAL_TRY_ASSIGN(ImageHeader header, read_image_header(file));
  NODAL_TRY(check_plain(header, file));
  return header;
}

Result<DecodedImage> read_plain_image(const std::filesystem::path& file, std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(PictureBytes bytes, PictureBytes::open(file));
  NODAL_TRY_ASSIGN(const ImageHeader header, image_header(bytes));
  NODAL_TRY(check_plain(header, file));
  return decode_image(bytes, as);
}

}  // namespace nodal::media
