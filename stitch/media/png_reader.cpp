#include "stitch/media/png_reader.h"

#include <png.h>

#include <csetjmp>
#include <cstring>

#include "stitch/media/png_meaning.h"

namespace nodal::media {

namespace {

/// libpng reports errors by longjmp, which skips destructors, so every resource is owned outside the code that jumps.
struct Reader {
  std::span<const std::uint8_t> bytes;
  std::size_t at = 0;
  bool ended_early = false;
  std::string why;
  png_structp png = nullptr;
  png_infop info = nullptr;
  DecodedImage image;
  std::vector<png_bytep> rows;

  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
};

void read_bytes(png_structp png, png_bytep into, std::size_t count) {
  auto* reader = static_cast<Reader*>(png_get_io_ptr(png));
  if (count > reader->bytes.size() - reader->at) {
    reader->ended_early = true;
    png_error(png, "no more data");
  }
  std::memcpy(into, reader->bytes.data() + reader->at, count);
  reader->at += count;
}

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  static_cast<Reader*>(png_get_error_ptr(png))->why = message;
  png_longjmp(png, 1);
}
void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

bool is_grey(const Reader& reader) { return (png_get_color_type(reader.png, reader.info) & PNG_COLOR_MASK_COLOR) == 0; }

std::optional<PixelFormat> deep_format(const Reader& reader) {
  if (png_get_bit_depth(reader.png, reader.info) != 16) return std::nullopt;
  return is_grey(reader) ? PixelFormat::kGrey16 : PixelFormat::kRgb48;
}

/// Reads up to the first row. On failure returns false and sets reader.why.
bool read_header(Reader& reader) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_read_info(reader.png, reader.info);
  reader.image.width = static_cast<int>(png_get_image_width(reader.png, reader.info));
  reader.image.height = static_cast<int>(png_get_image_height(reader.png, reader.info));
  reader.image.format = is_grey(reader) ? PixelFormat::kGrey8 : PixelFormat::kRgb24;
  reader.image.meaning.alpha = (png_get_color_type(reader.png, reader.info) & PNG_COLOR_MASK_ALPHA) != 0 ||
                               png_get_valid(reader.png, reader.info, PNG_INFO_tRNS) != 0;
  return true;
}

/// Reads the pixels of 8 bits with their alpha into `bytes`, which becomes as long as they are; alpha is the last of
/// `channels`.
bool read_with_alpha(Reader& reader, std::vector<std::uint8_t>& bytes, std::size_t& channels) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_set_expand(reader.png);
  png_set_scale_16(reader.png);
  png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  channels = png_get_channels(reader.png, reader.info);
  const std::size_t stride = png_get_rowbytes(reader.png, reader.info);
  bytes.resize(stride * static_cast<std::size_t>(reader.image.height));
  reader.rows.resize(static_cast<std::size_t>(reader.image.height));
  for (std::size_t y = 0; y < reader.rows.size(); ++y) reader.rows[y] = bytes.data() + y * stride;
  png_read_image(reader.png, reader.rows.data());
  png_read_end(reader.png, reader.info);
  return true;
}

bool read_rows(Reader& reader) {
  if (setjmp(png_jmpbuf(reader.png)) != 0) return false;
  png_set_expand(reader.png);
  if (is_linear16(reader.image.format)) {
    png_set_swap(reader.png);
  } else {
    png_set_scale_16(reader.png);
  }
  png_set_strip_alpha(reader.png);
  png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  // Longer rows would be written past the end of their buffers.
  const std::size_t expected = reader.image.bytes.size() / reader.rows.size();
  if (png_get_rowbytes(reader.png, reader.info) != expected) png_error(reader.png, "rows of unexpected length");
  png_read_image(reader.png, reader.rows.data());
  png_read_end(reader.png, reader.info);
  return true;
}

Error broken(const Reader& reader, const std::string& name) {
  return {reader.ended_early ? Errc::kTruncated : Errc::kBadFormat,
          "picture '" + name + "': " + (reader.ended_early ? "the PNG ends early" : "the PNG is broken") + " (" +
              reader.why + "); fetch or export it again"};
}

bool open(Reader& reader, std::span<const std::uint8_t> bytes) {
  reader.bytes = bytes;
  reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reader, on_error, on_warning);
  if (reader.png == nullptr) return false;
  reader.info = png_create_info_struct(reader.png);
  if (reader.info == nullptr) return false;
  png_set_user_limits(reader.png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // png_header()'s caller names the limit
  limit_chunks(reader.png);
  png_set_read_fn(reader.png, &reader, read_bytes);
  return read_header(reader);
}

}  // namespace

Result<ImageHeader> png_header(std::span<const std::uint8_t> bytes, const std::string& name) {
  Reader reader;
  if (!open(reader, bytes)) return fail(broken(reader, name));
  const DecodedImage& image = reader.image;
  ImageHeader header{image.width, image.height, image.format, deep_format(reader), image.meaning};
  read_meaning(reader.png, reader.info, header.meaning, header.metadata);
  return header;
}

Result<DecodedImage> decode_png(std::span<const std::uint8_t> bytes, const std::string& name, bool deep) {
  Reader reader;
  if (!open(reader, bytes)) return fail(broken(reader, name));
  DecodedImage& image = reader.image;
  if (deep) image.format = *deep_format(reader);
  image.bytes.resize(packed_size(image.format, image.width, image.height));
  const std::size_t stride = image.bytes.size() / static_cast<std::size_t>(image.height);
  for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y) {
    reader.rows.push_back(image.bytes.data() + y * stride);
  }
  if (!read_rows(reader)) return fail(broken(reader, name));
  read_meaning(reader.png, reader.info, image.meaning, image.metadata);
  return std::move(image);
}

Result<DecodedImage> decode_png_opacity(std::span<const std::uint8_t> bytes, const std::string& name) {
  Reader reader;
  if (!open(reader, bytes)) return fail(broken(reader, name));
  std::vector<std::uint8_t> pixels;
  std::size_t channels = 1;
  if (!read_with_alpha(reader, pixels, channels)) return fail(broken(reader, name));
  DecodedImage opacity{PixelFormat::kGrey8, reader.image.width, reader.image.height, {}};
  const bool alpha = channels == 2 || channels == 4;
  for (std::size_t k = channels - 1; k < pixels.size(); k += channels) opacity.bytes.push_back(alpha ? pixels[k] : 255);
  return opacity;
}

}  // namespace nodal::media
