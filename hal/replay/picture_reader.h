// A deck's interface to picture files. The ports know no picture format; the creator of a deck supplies a reader.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "protocol/base/decoded_image.h"
#include "protocol/base/picture_folder.h"
#include "protocol/base/result.h"

namespace nodal::hal::replay {

struct PictureReader {
  /// Reads a file's header.
  std::function<Result<ImageHeader>(const std::filesystem::path& file)> header;
  /// Reads the picture, in its own format or in `as`.
  std::function<Result<DecodedImage>(const std::filesystem::path& file, std::optional<PixelFormat> as)> read;
  /// Finds a folder's pictures. Errors: kNotFound if there is none, kIo.
  std::function<Result<PictureFolder>(const std::filesystem::path& folder)> folder;
};

}  // namespace nodal::hal::replay
