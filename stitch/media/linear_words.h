// The comment by which files of linear light say what their numbers stand for.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// What files with linear numbers begin their comment with.
inline constexpr std::string_view kLinearWords = "Numbers are proportional to light.";

/// The comment for a linear picture; empty for others.
std::string linear_comment(const SampleMeaning& meaning);

/// SampleMeaning::full_exposure_ns of such a comment.
std::optional<std::uint64_t> full_exposure_said(std::string_view comment);

}  // namespace nodal::media
