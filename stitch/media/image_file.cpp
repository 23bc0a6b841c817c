#include "stitch/media/image_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"
#include "stitch/media/file_kind.h"
#include "stitch/media/jpeg_reader.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/media/png_reader.h"

namespace nodal::media {

namespace {

constexpr std::array<std::uint8_t, 8> kPngMagic{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::array<std::uint8_t, 3> kJpegMagic{0xFF, 0xD8, 0xFF};

enum class Kind : std::uint8_t { kJpeg, kPng };

template <std::size_t kSize>
bool begins_with(std::span<const std::uint8_t> bytes, const std::array<std::uint8_t, kSize>& magic) {
  return bytes.size() >= kSize && std::equal(magic.begin(), magic.end(), bytes.begin());
}

Result<Kind> kind_of(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (bytes.empty()) return fail(Errc::kTruncated, "picture '" + name + "': the file is empty");
  if (begins_with(bytes, kJpegMagic)) return Kind::kJpeg;
  if (begins_with(bytes, kPngMagic)) return Kind::kPng;
  const FileKind* other = file_kind(bytes.first(std::min(bytes.size(), kFileKindBytes)), name);
  if (other == nullptr) {
    return fail(Errc::kBadFormat, "picture '" + name + "': is a TIFF, which is not read here: convert it to PNG");
  }
  return fail(Errc::kBadFormat, "picture '" + name + "': is " + text_of(*other));
}

Result<ImageHeader> header_of(std::span<const std::uint8_t> bytes, const std::string& name) {
  NODAL_TRY_ASSIGN(const auto kind, kind_of(bytes, name));
  auto header = kind == Kind::kJpeg ? jpeg_header(bytes, name) : png_header(bytes, name);
  if (header && (header->width > kMaxImageSide || header->height > kMaxImageSide)) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': is {}x{}, over the limit of {} a side", name, header->width,
                                             header->height, kMaxImageSide));
  }
  if (header &&
      static_cast<std::uint64_t>(header->width) * static_cast<std::uint64_t>(header->height) > kMaxPicturePixels) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': is {}x{}, over the limit of {} * 2^20 pixels", name,
                                             header->width, header->height, kMaxPicturePixels >> 20));
  }
  return header;
}

/// Refuses pictures that cannot be in so few bytes.
Status check_expansion(std::span<const std::uint8_t> bytes, const ImageHeader& header, PixelFormat format,
                       const std::string& name) {
  if (packed_size(format, header.width, header.height) <= kSmallImageBytes + kMaxExpansion * bytes.size()) return {};
  return fail(Errc::kTruncated, fmt::format("picture '{}': {} bytes cannot hold {}x{} pixels; fetch or export it again",
                                            name, bytes.size(), header.width, header.height));
}

}  // namespace

Result<DecodedImage> decode_image(std::span<const std::uint8_t> bytes, const std::string& name,
                                  std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(const auto header, header_of(bytes, name));
  if (as == PixelFormat::kMjpeg) {
    if (begins_with(bytes, kJpegMagic))
      return DecodedImage{*as, header.width, header.height, {bytes.begin(), bytes.end()}};
    return fail(Errc::kUnsupported, "picture '" + name + "': is no JPEG, which MJPEG needs; choose another format");
  }
  const bool deep = as && is_linear16(*as);
  if (deep && as != header.deep) {
    return fail(Errc::kUnsupported, "picture '" + name + "': does not have 16 bits a sample as " +
                                        std::string(pixel_format_name(*as)) + " needs");
  }
  NODAL_TRY(check_expansion(bytes, header, deep ? *as : header.natural, name));
  auto image = begins_with(bytes, kJpegMagic) ? decode_jpeg(bytes, name, as == PixelFormat::kRgb24)
                                              : decode_png(bytes, name, deep);
  if (!image || !as || *as == image->format) return image;
  DecodedImage converted = convert_image(image->view(), *as);
  converted.meaning = std::move(image->meaning);
  converted.metadata = std::move(image->metadata);
  return converted;
}

Result<DecodedImage> decode_image(PictureBytes& file, std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(const auto bytes, file.first(kMaxImageFileBytes + 1));
  if (bytes.size() > kMaxImageFileBytes) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': is over {} MiB", file.name(), kMaxImageFileBytes >> 20));
  }
  return decode_image(bytes, file.name(), as);
}

Result<DecodedImage> decode_opacity(PictureBytes& file) {
  NODAL_TRY_ASSIGN(const auto bytes, file.first(kMaxImageFileBytes));
  NODAL_TRY_ASSIGN(const auto header, header_of(bytes, file.name()));
  NODAL_TRY(check_expansion(bytes, header, header.natural, file.name()));
  if (begins_with(bytes, kPngMagic)) return decode_png_opacity(bytes, file.name());
  const auto pixels = packed_size(PixelFormat::kGrey8, header.width, header.height);
  return DecodedImage{PixelFormat::kGrey8, header.width, header.height, std::vector<std::uint8_t>(pixels, 255)};
}

Result<ImageHeader> image_header(PictureBytes& file) {
  // Most headers are within these first bytes, but a JPEG may have megabytes of metadata before its header.
  constexpr std::size_t kFirst = 64 * 1024;
  NODAL_TRY_ASSIGN(const auto bytes, file.first(kFirst));
  const std::size_t read = bytes.size();
  auto header = header_of(bytes, file.name());
  if (header || read < kFirst) return header;
  NODAL_TRY_ASSIGN(const auto all, file.first(kMaxImageFileBytes));
  return header_of(all, file.name());
}

Result<DecodedImage> read_image(const std::filesystem::path& file, std::optional<PixelFormat> as) {
  NODAL_TRY_ASSIGN(PictureBytes bytes, PictureBytes::open(file));
  return decode_image(bytes, as);
}

Result<ImageHeader> read_image_header(const std::filesystem::path& file) {
  NODAL_TRY_ASSIGN(PictureBytes bytes, PictureBytes::open(file));
  return image_header(bytes);
}

}  // namespace nodal::media
