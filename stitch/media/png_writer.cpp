#include "stitch/media/png_writer.h"

#include <png.h>

#include <array>
#include <csetjmp>

namespace nodal::media {
namespace {

void append(png_structp png, png_bytep data, png_size_t size) {
  auto* bytes = static_cast<std::vector<std::uint8_t>*>(png_get_io_ptr(png));
  bytes->insert(bytes->end(), data, data + size);
}

void give_up(png_structp png, png_const_charp) { png_longjmp(png, 1); }
void keep_quiet(png_structp, png_const_charp) {}

void set_notes(png_structp png, png_infop info, const PngNotes& notes) {
  const SampleMeaning& meaning = notes.meaning;
  if (meaning.curve == SampleMeaning::Curve::kSrgb) png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
  if (meaning.curve == SampleMeaning::Curve::kGamma) png_set_gAMA(png, info, 1 / meaning.gamma);
  if (!notes.exif.empty()) {
    // libpng copies the block, and takes a pointer that is not const.
    png_set_eXIf_1(png, info, static_cast<png_uint_32>(notes.exif.size()), const_cast<png_bytep>(notes.exif.data()));
  }
  const auto density = static_cast<png_uint_32>(notes.pixels_per_meter);
  if (density > 0) png_set_pHYs(png, info, density, density, PNG_RESOLUTION_METER);
  const auto add = [&](int kind, const char* key, const std::string& words) {
    if (words.empty()) return;
    png_text text{};
    text.compression = kind;
    text.key = const_cast<char*>(key);
    text.text = const_cast<char*>(words.c_str());
    png_set_text(png, info, &text, 1);
  };
  add(PNG_TEXT_COMPRESSION_NONE, "Comment", notes.comment);
  add(PNG_ITXT_COMPRESSION_NONE, "XML:com.adobe.xmp", notes.xmp);
}

/// libpng reports errors by longjmp, which skips destructors: no local here may own memory.
bool write(png_structp png, png_infop info, const PngPicture& picture, const PngNotes& notes,
           std::vector<std::uint8_t>* out) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_write_fn(png, out, append, nullptr);
  png_set_user_limits(png, 1 << 15, 1 << 15);
  png_set_compression_level(png, notes.effort);
  png_set_IHDR(png, info, static_cast<png_uint_32>(picture.width), static_cast<png_uint_32>(picture.height),
               picture.bits, picture.channels == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  set_notes(png, info, notes);
  png_write_info(png, info);
  if (picture.bits == 16) png_set_swap(png);  // PNG stores the high byte first
  const std::size_t stride = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.channels) *
                             static_cast<std::size_t>(picture.bits / 8);
  const std::uint8_t* row = picture.samples.data();
  for (int y = 0; y < picture.height; ++y, row += stride) png_write_row(png, row);
  png_write_end(png, nullptr);
  return true;
}

}  // namespace

Result<std::vector<std::uint8_t>> png_file(const PngPicture& picture, const PngNotes& notes) {
  std::vector<std::uint8_t> out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, give_up, keep_quiet);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  const bool written = info != nullptr && write(png, info, picture, notes, &out);
  png_destroy_write_struct(&png, &info);
  if (!written) return fail(Errc::kInternal, "libpng could not write the picture");
  return out;
}

}  // namespace nodal::media
