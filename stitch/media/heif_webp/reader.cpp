#include "stitch/media/heif_webp/reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string>

#include "protocol/base/try.h"
#include "stitch/media/file_kind.h"
#include "stitch/media/heif_webp/heif_reader.h"
#include "stitch/media/heif_webp/webp_reader.h"
#include "stitch/media/image_file.h"
#include "stitch/media/picture_bytes.h"

namespace nodal::media {
namespace {

/// The whole file. Errors: kTooLarge; those of reading it.
Result<std::span<const std::uint8_t>> all_of(PictureBytes& file) {
  NODAL_TRY_ASSIGN(const auto bytes, file.first(kMaxImageFileBytes + 1));
  if (bytes.size() > kMaxImageFileBytes) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': is over {} MiB", file.name(), kMaxImageFileBytes >> 20));
  }
  return bytes;
}

Result<ImageHeader> checked(Result<ImageHeader> header, const std::string& name) {
  if (!header) return header;
  const auto width = static_cast<std::uint64_t>(header->width), height = static_cast<std::uint64_t>(header->height);
  if (header->width < 1 || header->height < 1)
    return fail(Errc::kBadFormat, "picture '" + name + "': it has no pixels; fetch or export it again");
  if (header->width > kMaxImageSide || header->height > kMaxImageSide || width * height > kMaxCodedPixels) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': is {}x{}, over the limit of {} a side and {} * 2^20 pixels",
                                             name, width, height, kMaxImageSide, kMaxCodedPixels >> 20));
  }
  return header;
}

}  // namespace

bool is_heif_or_webp(PictureBytes& file) {
  const auto head = file.first(kFileKindBytes);
  const FileKind* kind = head ? file_kind(*head, file.name()) : nullptr;
  return kind != nullptr && kind->read_by_hosts && (is_webp(*head) || is_heif(*head));
}

bool is_turned(PictureBytes& file) {
  const auto head = file.first(kFileKindBytes);
  return head && is_heif(*head);
}

Result<ImageHeader> heif_or_webp_header(PictureBytes& file) {
  NODAL_TRY_ASSIGN(const auto bytes, all_of(file));
  return checked(is_webp(bytes) ? webp_header(bytes, file.name()) : heif_header(bytes, file.name()), file.name());
}

int count_pictures(PictureBytes& file) {
  if (!is_turned(file) || !is_heif_or_webp(file)) return 1;
  const auto bytes = all_of(file);
  return bytes ? std::max(1, count_heif_pictures(*bytes)) : 1;
}

Result<DecodedImage> decode_heif_or_webp(PictureBytes& file) {
  NODAL_TRY_ASSIGN(const ImageHeader header, heif_or_webp_header(file));
  NODAL_TRY_ASSIGN(const auto bytes, all_of(file));
  return is_webp(bytes) ? decode_webp(bytes, header, file.name()) : decode_heif(bytes, header, file.name());
}

Result<DecodedImage> decode_heif_or_webp_opacity(PictureBytes& file) {
  NODAL_TRY_ASSIGN(const ImageHeader header, heif_or_webp_header(file));
  NODAL_TRY_ASSIGN(const auto bytes, all_of(file));
  if (!header.meaning.alpha) {
    const auto pixels = packed_size(PixelFormat::kGrey8, header.width, header.height);
    return DecodedImage{PixelFormat::kGrey8, header.width, header.height, std::vector<std::uint8_t>(pixels, 255)};
  }
  return is_webp(bytes) ? decode_webp_opacity(bytes, header, file.name())
                        : decode_heif_opacity(bytes, header, file.name());
}

}  // namespace nodal::media
