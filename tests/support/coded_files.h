// HEIF and WebP files for tests, written directly by libheif and libwebp.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace nodal::test {

struct CodedPicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< packed; RGBA with `alpha`
  bool alpha = false;
  std::vector<std::uint8_t> icc{};
  std::vector<std::uint8_t> exif{};  ///< a TIFF structure
};

/// Whether libheif can code HEVC here, which needs its plugin for x265.
bool can_code_heif();

/// HEVC, nearly without loss. `orientation`: 1 to 8, as transformations that readers apply. `others`: further pictures
/// before the primary one, as in a burst.
std::vector<std::uint8_t> heif_of(const CodedPicture& picture, int orientation = 1,
                                  const std::vector<CodedPicture>& others = {});

/// Without loss.
std::vector<std::uint8_t> webp_of(const CodedPicture& picture);

/// A file of two frames, one pixel each.
std::vector<std::uint8_t> animated_webp();

}  // namespace nodal::test
