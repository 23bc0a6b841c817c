// Limits of requests and settings, in one place for rig and host.
#pragma once

#include <cstdint>
#include <string_view>

namespace nodal {

/// The rates that FrameRate::make() accepts, for error messages.
inline constexpr std::string_view kFrameRatesAllowed =
    "1/1000 to 1000 frames a second, as a fraction whose reduced terms are at most 1000000";

/// Thousandths of a decibel, positive or negative: ten stops. No head has a wider range.
inline constexpr std::int32_t kMostGainMdb = 60'000;

}  // namespace nodal
