// Pictures as files of any format that nodal reads: JPEG, PNG, TIFF.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// A picture in sRGB's numbers (media::in_srgb): GREY, I420 or RGB24 as its file suits; `as`: GREY or RGB24 instead.
/// `of_linear_head`: numbers that the file calls proportional to light stay so, as the head's response has them.
/// Errors: those of the readers and of in_srgb(); each names the file.
Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as = std::nullopt,
                                  bool of_linear_head = false);

/// The same with all 16 bits, as GREY16 or RGB48, if the file has them, and otherwise as GREY or RGB24. Numbers of 16 bits
/// that are proportional to light stay so; meaning.is_linear() says it.
Result<DecodedImage> read_deep_picture(const std::string& file);

/// Several pictures in their natural formats, on all cores. `begin(n)` is called on the caller's thread before pictures n
/// and later are read. `of_linear_heads[n]`: as for read_picture(); empty: none.
/// Errors: that of the first file, in their order, that has one.
Result<std::vector<DecodedImage>> read_all(
    const std::vector<std::string>& files, const std::function<void(std::size_t n)>& begin = [](std::size_t) {},
    const std::vector<bool>& of_linear_heads = {});

/// The same picture in another format of 8 bits: media::convert_image() with meaning and metadata.
DecodedImage in_format(DecodedImage picture, PixelFormat format);

/// The heads whose response is linear.
std::vector<bool> linear_heads(const Calibration& calibration);

/// Its size and natural format, without decoding it.
Result<ImageHeader> read_picture_header(const std::string& file);

}  // namespace nodal::host
