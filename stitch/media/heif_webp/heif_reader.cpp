#include "stitch/media/heif_webp/heif_reader.h"

#include <fmt/format.h>

#include <libheif/heif.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/media/code_points.h"
#include "stitch/media/heif_webp/heif_references.h"
#include "stitch/media/heif_webp/reader.h"
#include "stitch/media/image_file.h"

namespace nodal::media {
namespace {

template <auto free>
struct Free {
  template <class Value>
  void operator()(Value* value) const {
    free(value);
  }
};
using Context = std::unique_ptr<heif_context, Free<&heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Free<&heif_image_handle_release>>;
using Image = std::unique_ptr<heif_image, Free<&heif_image_release>>;
using DecodingOptions = std::unique_ptr<heif_decoding_options, Free<&heif_decoding_options_free>>;

struct File {
  Context context;
  Handle primary;
};

Error error_of(const heif_error& error, const std::string& name) {
  const std::string text = "picture '" + name + "': ";
  const std::string said = error.message != nullptr ? error.message : "no reason given";
  if (error.code == heif_error_Unsupported_filetype || error.code == heif_error_Unsupported_feature ||
      error.code == heif_error_Decoder_plugin_error) {
    return {Errc::kUnsupported, text + "the HEIF file cannot be decoded (" + said +
                                    "); convert it to JPEG (heif-convert FILE.heic FILE.jpg)"};
  }
  const bool early = error.subcode == heif_suberror_End_of_data;
  return {early ? Errc::kTruncated : Errc::kBadFormat,
          text + "the HEIF file " + (early ? "ends early" : "is broken") + " (" + said + "); fetch or export it again"};
}

/// The bytes must outlive it.
Result<File> opened(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (!are_references_bounded(bytes)) {
    return fail(Errc::kBadFormat, fmt::format("picture '{}': the HEIF file is broken (a picture in it is a part of "
                                              "itself, or of too many others); fetch or export it again",
                                              name));
  }
  File file{Context(heif_context_alloc()), nullptr};
  if (!file.context) return fail(Errc::kInternal, "picture '" + name + "': no memory for libheif");
  heif_context_set_maximum_image_size_limit(file.context.get(), kMaxImageSide);
  heif_error error =
      heif_context_read_from_memory_without_copy(file.context.get(), bytes.data(), bytes.size(), nullptr);
  if (error.code != heif_error_Ok) return fail(error_of(error, name));
  heif_image_handle* primary = nullptr;
  error = heif_context_get_primary_image_handle(file.context.get(), &primary);
  if (error.code != heif_error_Ok) return fail(error_of(error, name));
  file.primary.reset(primary);
  return file;
}

/// Empty if there is none, or if it is longer than kMaxCodedMetadata.
std::vector<std::uint8_t> block(const heif_image_handle* handle, std::string_view type, std::string_view content) {
  std::array<heif_item_id, 16> ids{};
  const int count = heif_image_handle_get_list_of_metadata_block_IDs(handle, nullptr, ids.data(), ids.size());
  for (int k = 0; k < count; ++k) {
    const heif_item_id id = ids[static_cast<std::size_t>(k)];
    const auto said = [](const char* text) { return std::string_view(text != nullptr ? text : ""); };
    if (said(heif_image_handle_get_metadata_type(handle, id)) != type) continue;
    if (!content.empty() && said(heif_image_handle_get_metadata_content_type(handle, id)) != content) continue;
    const std::size_t size = heif_image_handle_get_metadata_size(handle, id);
    if (size > kMaxCodedMetadata) return {};
    std::vector<std::uint8_t> data(size);
    if (heif_image_handle_get_metadata(handle, id, data.data()).code != heif_error_Ok) return {};
    return data;
  }
  return {};
}

/// The block begins with the offset of the TIFF structure behind these four bytes (ISO/IEC 23008-12, A.2.1).
std::vector<std::uint8_t> exif_of_block(std::vector<std::uint8_t> data) {
  if (data.size() < 4) return {};
  const std::uint64_t offset =
      std::uint64_t{data[0]} << 24 | std::uint64_t{data[1]} << 16 | std::uint64_t{data[2]} << 8 | data[3];
  if (offset > data.size() - 4) return {};
  data.erase(data.begin(), data.begin() + 4 + static_cast<std::ptrdiff_t>(offset));
  return data;
}

/// libheif applies matrix and range itself.
Status read_meaning(const heif_image_handle* handle, SampleMeaning& meaning, const std::string& name) {
  const std::size_t size = heif_image_handle_get_raw_color_profile_size(handle);
  if (size > kMaxCodedMetadata) {
    return fail(Errc::kTooLarge, fmt::format("picture '{}': its colour profile is over {} MiB; convert it to sRGB",
                                             name, kMaxCodedMetadata >> 20));
  }
  meaning.alpha = heif_image_handle_has_alpha_channel(handle) != 0;
  if (size > 0) {
    meaning.icc.resize(size);
    const heif_error error = heif_image_handle_get_raw_color_profile(handle, meaning.icc.data());
    return error.code == heif_error_Ok ? Status{} : Status(fail(error_of(error, name)));
  }
  heif_color_profile_nclx* points = nullptr;
  if (heif_image_handle_get_nclx_color_profile(handle, &points).code != heif_error_Ok || points == nullptr) return {};
  const std::array<std::uint8_t, 4> said{static_cast<std::uint8_t>(points->color_primaries),
                                         static_cast<std::uint8_t>(points->transfer_characteristics), 0, 1};
  heif_nclx_color_profile_free(points);
  set_code_points(said, meaning);
  return {};
}

Result<ImageHeader> header_of(const heif_image_handle* handle, const std::string& name) {
  ImageHeader header;
  header.width = heif_image_handle_get_width(handle);
  header.height = heif_image_handle_get_height(handle);
  NODAL_TRY(read_meaning(handle, header.meaning, name));
  header.metadata.exif = exif_of_block(block(handle, "Exif", ""));
  const std::vector<std::uint8_t> xmp = block(handle, "mime", "application/rdf+xml");
  header.metadata.xmp.assign(xmp.begin(), xmp.end());
  return header;
}

/// The decoded picture, its channels interleaved.
struct Pixels {
  Image image;
  const std::uint8_t* first = nullptr;
  int stride = 0;

  const std::uint8_t* row(int y) const { return first + static_cast<std::ptrdiff_t>(y) * stride; }
};

Result<Pixels> pixels_of(std::span<const std::uint8_t> bytes, heif_chroma channels, const ImageHeader& header,
                         const std::string& name) {
  NODAL_TRY_ASSIGN(const File file, opened(bytes, name));
  const DecodingOptions options(heif_decoding_options_alloc());
  if (!options) return fail(Errc::kInternal, "picture '" + name + "': no memory for libheif");
  options->strict_decoding = 1;
  options->convert_hdr_to_8bit = 1;
  heif_image* decoded = nullptr;
  const heif_error error =
      heif_decode_image(file.primary.get(), &decoded, heif_colorspace_RGB, channels, options.get());
  if (error.code != heif_error_Ok) return fail(error_of(error, name));
  Pixels pixels{Image(decoded)};
  pixels.first = heif_image_get_plane_readonly(decoded, heif_channel_interleaved, &pixels.stride);
  if (pixels.first == nullptr || heif_image_get_width(decoded, heif_channel_interleaved) != header.width ||
      heif_image_get_height(decoded, heif_channel_interleaved) != header.height) {
    return fail(Errc::kBadFormat, "picture '" + name + "': its pixels are not as many as the HEIF file says");
  }
  return pixels;
}

}  // namespace

bool is_heif(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.size() >= 12 && text.substr(4, 4) == "ftyp";
}

Result<ImageHeader> heif_header(std::span<const std::uint8_t> bytes, const std::string& name) {
  NODAL_TRY_ASSIGN(const File file, opened(bytes, name));
  return header_of(file.primary.get(), name);
}

int count_heif_pictures(std::span<const std::uint8_t> bytes) {
  const Result<File> file = opened(bytes, "");
  return file ? heif_context_get_number_of_top_level_images(file->context.get()) : 0;
}

Result<DecodedImage> decode_heif(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                 const std::string& name) {
  NODAL_TRY_ASSIGN(const Pixels pixels, pixels_of(bytes, heif_chroma_interleaved_RGB, header, name));
  DecodedImage picture{PixelFormat::kRgb24, header.width, header.height, {}, header.meaning, header.metadata};
  picture.bytes.resize(packed_size(picture.format, header.width, header.height));
  for (int y = 0; y < header.height; ++y) {
    std::copy_n(pixels.row(y), static_cast<std::ptrdiff_t>(3) * header.width,
                picture.bytes.begin() + static_cast<std::ptrdiff_t>(3) * header.width * y);
  }
  return picture;
}

Result<DecodedImage> decode_heif_opacity(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                         const std::string& name) {
  NODAL_TRY_ASSIGN(const Pixels pixels, pixels_of(bytes, heif_chroma_interleaved_RGBA, header, name));
  DecodedImage opacity{PixelFormat::kGrey8, header.width, header.height, {}};
  for (int y = 0; y < header.height; ++y) {
    const std::uint8_t* const row = pixels.row(y);
    for (int x = 0; x < header.width; ++x) opacity.bytes.push_back(row[4 * x + 3]);
  }
  return opacity;
}

}  // namespace nodal::media
