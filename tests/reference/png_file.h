// PNG pictures for tests, using only libpng: shares no code with Nodal's picture readers.
#pragma once

#include <filesystem>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::test {

/// A packed RGB24 or GREY picture that owns its bytes.
struct Picture {
  PixelFormat format = PixelFormat::kRgb24;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;

  Picture() = default;
  Picture(PixelFormat format_, int width_, int height_, std::uint8_t fill = 0)
      : format(format_), width(width_), height(height_), bytes(packed_size(format_, width_, height_), fill) {}
  ImageView view() const { return packed_image(format, width, height, bytes.data()); }
  MutableImageView mutable_view() { return packed_image(format, width, height, bytes.data()); }
};

/// Reads any PNG as RGB24. Errors: kBadFormat, with libpng's message.
Result<Picture> read_png(const std::filesystem::path& file);

/// Writes an RGB24 or GREY picture. Errors: kIo.
Status write_png(const std::filesystem::path& file, const Picture& picture);

}  // namespace nodal::test
