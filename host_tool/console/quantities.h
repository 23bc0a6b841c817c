// Parses and formats exposures, gains and rates for users. Where two units are in use, a number without a unit is
// refused.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::host {

/// The units of every duration that a user writes, for messages.
inline constexpr std::string_view kDurationUnits = "ns, us, ms, s, m or min (minutes), h (hours) and d (days)";
/// A longer one indicates a wrong unit.
inline constexpr Duration kLongestDuration = Duration::seconds(86'400);

/// "250us", "8ms", "0.5s", "2min" or "2m", "3h". Errors: kBadValue; the message names the units.
Result<Duration> parse_duration(std::string_view text);
/// The same for times that may be longer; nothing if the text is no duration or a longer one.
std::optional<Duration> duration_of(std::string_view text, Duration longest);
/// "8ms", "500us", or a fraction of a second as on cameras: "1/125".
Result<Exposure> parse_exposure(std::string_view text);
/// "6dB", "-3.5dB", "0dB".
Result<Gain> parse_gain(std::string_view text);
/// Red and blue relative to green: "1.5,1.25". "1,1" changes nothing.
Result<WhiteBalance> parse_white_balance(std::string_view text);
/// "2.2" gives 2200 (thousandths); "own" gives 0: the curve of the head's calibration.
Result<std::uint32_t> parse_gamma(std::string_view text);
/// "2.5" stops, 0 to 8, in thousandths.
Result<std::uint32_t> parse_stops(std::string_view text);
/// "30000/1001", "25", "29.97" (the NTSC rates 23.976, 29.97 and 59.94 mean n/1001), "12.5".
Result<FrameRate> parse_rate(std::string_view text);

/// The absolute value, also of the lowest number, whose negative does not fit int64.
constexpr std::uint64_t magnitude(std::int64_t ns) {
  return ns < 0 ? std::uint64_t{0} - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
}

std::string counted(std::uint64_t count, std::string_view one);  ///< "1 pulse", "2 pulses"
std::string show_duration(std::uint64_t ns);  ///< "450 ns", "12.3 µs", "8 ms", "1.5 s", "2 h 03 min"
std::string show_exposure(std::uint64_t ns);  ///< "8 ms"
std::string show_gain(std::int32_t mdb);      ///< "6.02 dB"
std::string show_white_balance(std::uint32_t red_q12, std::uint32_t blue_q12);  ///< "1.50, 1.25"
std::string show_rate(std::uint32_t millihertz);                                ///< "29.970"
std::string show_bytes(std::uint64_t bytes);                                    ///< "512 B", "1.5 MB"
std::string show_id(const std::string& id_bytes);  ///< the first 12 hexadecimal digits, or "none"

/// A standard deviation with its unit: "fixed" for 0 (the number was not estimated), "?" if it is not known.
std::string show_deviation(double value, std::string_view unit);

}  // namespace nodal::host
