// How a deck reads pictures. The ports know no picture format; the caller that makes a deck passes a reader.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::hal::replay {

struct PictureReader {
  /// What a file's header says.
  std::function<Result<ImageHeader>(const std::filesystem::path& file)> header;
  /// The picture, in its own format or in `as`.
  std::function<Result<DecodedImage>(const std::filesystem::path& file, std::optional<PixelFormat> as)> read;
};

}  // namespace nodal::hal::replay
