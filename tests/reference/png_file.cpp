#include "tests/reference/png_file.h"

#include <png.h>

namespace nodal::test {

Result<Picture> read_png(const std::filesystem::path& file) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_file(&image, file.c_str()) == 0) {
    return fail(Errc::kBadFormat, file.string() + ": " + image.message);
  }
  image.format = PNG_FORMAT_RGB;
  Picture picture(PixelFormat::kRgb24, static_cast<int>(image.width), static_cast<int>(image.height));
  if (png_image_finish_read(&image, nullptr, picture.bytes.data(), 0, nullptr) == 0) {
    return fail(Errc::kBadFormat, file.string() + ": " + image.message);
  }
  return picture;
}

Status write_png(const std::filesystem::path& file, const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = picture.format == PixelFormat::kGrey8 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  if (png_image_write_to_file(&image, file.c_str(), 0, picture.bytes.data(), 0, nullptr) == 0) {
    return fail(Errc::kIo, file.string() + ": " + image.message);
  }
  return {};
}

}  // namespace nodal::test
