// Limits of requests, settings and pictures, in one place for rig and host.
#pragma once

#include <cstdint>
#include <string_view>

namespace nodal {

/// The rates that FrameRate::make() accepts, for error messages.
inline constexpr std::string_view kFrameRatesAllowed =
    "1/1000 to 1000 frames a second, as a fraction whose reduced terms are at most 1000000";

/// Pixels of a picture in a file: those of the largest raymap, 32768 x 16384, which takes 1.6 GB.
inline constexpr std::uint64_t kMaxPicturePixels = std::uint64_t{1} << 29;

/// Thousandths of a decibel, positive or negative: ten stops. No head has a wider range.
inline constexpr std::int32_t kMaxGainMdb = 60'000;

}  // namespace nodal
