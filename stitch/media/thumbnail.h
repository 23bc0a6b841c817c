// Small pictures of JPEGs.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::media {

/// A JPEG with an eighth of another one's width and height, rounded up: means of 8 x 8 pixels. `name` is for errors.
///
/// Threading: thread-safe.
/// Errors: those of a JPEG that read_image() refuses; kInternal with TurboJPEG's message.
Result<std::vector<std::uint8_t>> thumbnail(std::span<const std::uint8_t> jpeg, const std::string& name);

/// Whether the bytes begin and end as a JPEG does: a file that was cut does not.
bool is_whole_jpeg(std::span<const std::uint8_t> bytes);

}  // namespace nodal::media
