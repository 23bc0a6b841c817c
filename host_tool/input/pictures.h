// Pictures as files of any format that nodal reads: JPEG, PNG, TIFF.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// A picture as media::decode_image() or media::read_tiff() gives it; `as`: GREY or RGB24 instead of its natural format.
/// Errors: theirs; each names the file.
Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as = std::nullopt);

/// Several pictures in their natural formats, on all cores. `begin(n)` is called on the caller's thread before pictures n
/// and later are read.
/// Errors: that of the first file, in their order, that has one.
Result<std::vector<DecodedImage>> read_all(
    const std::vector<std::string>& files, const std::function<void(std::size_t n)>& begin = [](std::size_t) {});

/// Its size and natural format, without decoding it.
Result<ImageHeader> read_picture_header(const std::string& file);

/// The files of a folder that start like pictures, sorted by name.
/// Errors: kIo when the folder cannot be read, kNotFound when no file in it is a picture.
Result<std::vector<std::string>> pictures_in(const std::string& folder);

/// Whether a name ends like that of a picture, in any case.
bool named_like_a_picture(const std::string& file);

}  // namespace nodal::host
