#include "tests/support/coded_files.h"

#include <libheif/heif.h>
#include <webp/encode.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string_view>

namespace nodal::test {
namespace {

void need(const heif_error& error) {
  if (error.code != heif_error_Ok) throw std::runtime_error(error.message);
}

heif_error append(heif_context*, const void* data, std::size_t size, void* into) {
  auto& bytes = *static_cast<std::vector<std::uint8_t>*>(into);
  const auto* from = static_cast<const std::uint8_t*>(data);
  bytes.insert(bytes.end(), from, from + size);
  return {heif_error_Ok, heif_suberror_Unspecified, "ok"};
}

/// Adds a picture to a file.
void add(heif_context* context, heif_encoder* encoder, const CodedPicture& picture, int orientation, bool primary) {
  heif_image* image = nullptr;
  const heif_chroma chroma = picture.alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB;
  need(heif_image_create(picture.width, picture.height, heif_colorspace_RGB, chroma, &image));
  need(heif_image_add_plane(image, heif_channel_interleaved, picture.width, picture.height, 8));
  int stride = 0;
  std::uint8_t* plane = heif_image_get_plane(image, heif_channel_interleaved, &stride);
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(picture.alpha ? 4 : 3) * picture.width;
  for (int y = 0; y < picture.height; ++y)
    std::copy_n(picture.rgb.begin() + y * row, row, plane + std::ptrdiff_t{y} * stride);
  if (!picture.icc.empty())
    need(heif_image_set_raw_color_profile(image, "prof", picture.icc.data(), picture.icc.size()));
  heif_encoding_options* options = heif_encoding_options_alloc();
  options->image_orientation = static_cast<heif_orientation>(orientation);
  heif_image_handle* handle = nullptr;
  need(heif_context_encode_image(context, image, encoder, options, &handle));
  if (!picture.exif.empty())
    need(heif_context_add_exif_metadata(context, handle, picture.exif.data(), static_cast<int>(picture.exif.size())));
  if (primary) need(heif_context_set_primary_image(context, handle));
  heif_image_handle_release(handle);
  heif_encoding_options_free(options);
  heif_image_release(image);
}

void put(std::vector<std::uint8_t>& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::uint8_t>(c));
}
void put(std::vector<std::uint8_t>& bytes, std::uint32_t number, int count) {
  for (int k = 0; k < count; ++k) bytes.push_back(static_cast<std::uint8_t>(number >> 8 * k));
}
void put_chunk(std::vector<std::uint8_t>& bytes, std::string_view name, const std::vector<std::uint8_t>& data) {
  put(bytes, name);
  put(bytes, static_cast<std::uint32_t>(data.size()), 4);
  bytes.insert(bytes.end(), data.begin(), data.end());
  if (data.size() % 2 != 0) bytes.push_back(0);
}

std::vector<std::uint8_t> riff(const std::vector<std::uint8_t>& chunks) {
  std::vector<std::uint8_t> file;
  put(file, "RIFF");
  put(file, static_cast<std::uint32_t>(chunks.size() + 4), 4);
  put(file, "WEBP");
  file.insert(file.end(), chunks.begin(), chunks.end());
  return file;
}

/// Without the header of the file.
std::vector<std::uint8_t> chunks_of(const CodedPicture& picture) {
  std::uint8_t* coded = nullptr;
  const std::size_t size =
      picture.alpha
          ? WebPEncodeLosslessRGBA(picture.rgb.data(), picture.width, picture.height, 4 * picture.width, &coded)
          : WebPEncodeLosslessRGB(picture.rgb.data(), picture.width, picture.height, 3 * picture.width, &coded);
  std::vector<std::uint8_t> bytes(coded + 12, coded + size);
  WebPFree(coded);
  return bytes;
}

/// VP8X (RFC 9649, section 2.7).
std::vector<std::uint8_t> extended(std::uint32_t flags, int width, int height) {
  std::vector<std::uint8_t> data;
  put(data, flags, 4);
  put(data, static_cast<std::uint32_t>(width - 1), 3);
  put(data, static_cast<std::uint32_t>(height - 1), 3);
  return data;
}

}  // namespace

bool can_code_heif() { return heif_have_encoder_for_format(heif_compression_HEVC) != 0; }

std::vector<std::uint8_t> heif_of(const CodedPicture& picture, int orientation,
                                  const std::vector<CodedPicture>& others) {
  heif_context* context = heif_context_alloc();
  heif_encoder* encoder = nullptr;
  need(heif_context_get_encoder_for_format(context, heif_compression_HEVC, &encoder));
  need(heif_encoder_set_lossy_quality(encoder, 97));
  for (const CodedPicture& other : others) add(context, encoder, other, 1, false);
  add(context, encoder, picture, orientation, true);
  std::vector<std::uint8_t> bytes;
  heif_writer writer{1, &append};
  need(heif_context_write(context, &writer, &bytes));
  heif_encoder_release(encoder);
  heif_context_free(context);
  return bytes;
}

std::vector<std::uint8_t> webp_of(const CodedPicture& picture) {
  constexpr std::uint32_t kIcc = 0x20, kAlpha = 0x10, kExif = 0x08;
  if (picture.icc.empty() && picture.exif.empty()) return riff(chunks_of(picture));
  std::vector<std::uint8_t> chunks;
  const std::uint32_t flags =
      (picture.icc.empty() ? 0 : kIcc) | (picture.alpha ? kAlpha : 0) | (picture.exif.empty() ? 0 : kExif);
  put_chunk(chunks, "VP8X", extended(flags, picture.width, picture.height));
  if (!picture.icc.empty()) put_chunk(chunks, "ICCP", picture.icc);
  const auto pixels = chunks_of(picture);
  chunks.insert(chunks.end(), pixels.begin(), pixels.end());
  if (!picture.exif.empty()) put_chunk(chunks, "EXIF", picture.exif);
  return riff(chunks);
}

std::vector<std::uint8_t> animated_webp() {
  constexpr std::uint32_t kAnimation = 0x02;
  std::vector<std::uint8_t> chunks, frame(16, 0);
  put_chunk(chunks, "VP8X", extended(kAnimation, 1, 1));
  put_chunk(chunks, "ANIM", std::vector<std::uint8_t>(6, 0));
  const auto pixel = chunks_of({1, 1, {200, 100, 50}});
  frame.insert(frame.end(), pixel.begin(), pixel.end());
  for (int k = 0; k < 2; ++k) put_chunk(chunks, "ANMF", frame);
  return riff(chunks);
}

}  // namespace nodal::test
