#include "stitch/media/heif_webp/webp_reader.h"

#include <fmt/format.h>

#include <webp/decode.h>

#include <algorithm>
#include <string_view>

#include "stitch/media/heif_webp/reader.h"

namespace nodal::media {
namespace {

Error broken(VP8StatusCode status, const std::string& name) {
  const bool early = status == VP8_STATUS_NOT_ENOUGH_DATA || status == VP8_STATUS_SUSPENDED;
  return {early ? Errc::kTruncated : Errc::kBadFormat,
          "picture '" + name + "': " + (early ? "the WebP ends early" : "the WebP is broken") +
              "; fetch or export it again"};
}

std::size_t little_endian(std::span<const std::uint8_t> four) {
  return four[0] | static_cast<std::size_t>(four[1]) << 8 | static_cast<std::size_t>(four[2]) << 16 |
         static_cast<std::size_t>(four[3]) << 24;
}

/// The data of the first chunk with this name (RFC 9649, section 2.3); empty if there is none, or if it is cut.
std::span<const std::uint8_t> chunk(std::span<const std::uint8_t> bytes, std::string_view name) {
  constexpr std::size_t kRiffHeader = 12, kChunkHeader = 8;
  for (std::size_t at = kRiffHeader; at + kChunkHeader <= bytes.size();) {
    const std::size_t length = little_endian(bytes.subspan(at + 4, 4));
    const auto data = bytes.subspan(at + kChunkHeader);
    if (length > data.size()) return {};
    if (std::equal(name.begin(), name.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at)))
      return data.first(length);
    at += kChunkHeader + length + length % 2;
  }
  return {};
}

}  // namespace

bool is_webp(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.starts_with("RIFF") && text.size() >= 12 && text.substr(8, 4) == "WEBP";
}

Result<ImageHeader> webp_header(std::span<const std::uint8_t> bytes, const std::string& name) {
  WebPBitstreamFeatures about;
  if (const VP8StatusCode status = WebPGetFeatures(bytes.data(), bytes.size(), &about); status != VP8_STATUS_OK)
    return fail(broken(status, name));
  if (about.has_animation != 0) {
    return fail(Errc::kUnsupported, "picture '" + name +
                                        "': it is an animated WebP; give its pictures one by one (webpmux -get frame 1 "
                                        "FILE.webp -o picture.webp)");
  }
  ImageHeader header;
  header.width = about.width;
  header.height = about.height;
  header.meaning.alpha = about.has_alpha != 0;
  const auto profile = chunk(bytes, "ICCP");
  if (profile.size() > kMaxCodedMetadata) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': its colour profile is over {} MiB; convert it to sRGB",
                                             name, kMaxCodedMetadata >> 20));
  }
  header.meaning.icc.assign(profile.begin(), profile.end());
  auto exif = chunk(bytes, "EXIF");
  constexpr std::string_view kExifStart{"Exif\0\0", 6};  // as some programs write it
  if (exif.size() >= kExifStart.size() && std::equal(kExifStart.begin(), kExifStart.end(), exif.begin()))
    exif = exif.subspan(kExifStart.size());
  if (exif.size() <= kMaxCodedMetadata) header.metadata.exif.assign(exif.begin(), exif.end());
  const auto xmp = chunk(bytes, "XMP ");
  if (xmp.size() <= kMaxCodedMetadata) header.metadata.xmp.assign(xmp.begin(), xmp.end());
  return header;
}

Result<DecodedImage> decode_webp(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                 const std::string& name) {
  WebPDecoderConfig config;
  if (WebPInitDecoderConfig(&config) == 0)
    return fail(Errc::kInternal, "picture '" + name + "': libwebp is another one");
  DecodedImage image{PixelFormat::kRgb24, header.width, header.height, {}, header.meaning, header.metadata};
  image.bytes.resize(packed_size(image.format, image.width, image.height));
  config.output.colorspace = MODE_RGB;
  config.output.is_external_memory = 1;
  config.output.u.RGBA = {image.bytes.data(), 3 * image.width, image.bytes.size()};
  if (const VP8StatusCode status = WebPDecode(bytes.data(), bytes.size(), &config); status != VP8_STATUS_OK)
    return fail(broken(status, name));
  return image;
}

Result<DecodedImage> decode_webp_opacity(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                         const std::string& name) {
  WebPDecoderConfig config;
  if (WebPInitDecoderConfig(&config) == 0)
    return fail(Errc::kInternal, "picture '" + name + "': libwebp is another one");
  std::vector<std::uint8_t> pixels(std::size_t{4} * static_cast<std::size_t>(header.width) *
                                   static_cast<std::size_t>(header.height));
  config.output.colorspace = MODE_RGBA;
  config.output.is_external_memory = 1;
  config.output.u.RGBA = {pixels.data(), 4 * header.width, pixels.size()};
  if (const VP8StatusCode status = WebPDecode(bytes.data(), bytes.size(), &config); status != VP8_STATUS_OK)
    return fail(broken(status, name));
  DecodedImage opacity{PixelFormat::kGrey8, header.width, header.height, {}};
  for (std::size_t k = 3; k < pixels.size(); k += 4) opacity.bytes.push_back(pixels[k]);
  return opacity;
}

}  // namespace nodal::media
