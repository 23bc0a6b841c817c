#include "host_tool/console/quantities.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "protocol/base/limits.h"

namespace nodal::host {
namespace {

/// A number and the text after it; nothing if the text does not start with a finite number.
struct Quantity {
  double number = 0;
  std::string_view unit;
};
std::optional<Quantity> split(std::string_view text) {
  Quantity quantity;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), quantity.number);
  if (error != std::errc() || !std::isfinite(quantity.number)) return std::nullopt;
  quantity.unit = text.substr(static_cast<std::size_t>(end - text.data()));
  if (quantity.unit.starts_with(' ')) quantity.unit.remove_prefix(1);
  return quantity;
}

template <class Number>
std::optional<Number> whole(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::optional<double> ns_per(std::string_view unit) {
  if (unit == "ns") return 1.0;
  if (unit == "us" || unit == "µs") return 1e3;
  if (unit == "ms") return 1e6;
  if (unit == "s") return 1e9;
  if (unit == "min" || unit == "m") return 60e9;
  if (unit == "h") return 3600e9;
  if (unit == "d") return 86'400e9;
  return std::nullopt;
}

tl::unexpected<Error> bad(std::string_view what, std::string_view text, std::string_view allowed) {
  return fail(Errc::kBadValue, fmt::format("{} '{}': write it as {}", what, text, allowed));
}

std::optional<std::int64_t> to_ns(std::string_view text, Duration longest) {
  const std::optional<Quantity> quantity = split(text);
  if (!quantity) return std::nullopt;
  const std::optional<double> unit = ns_per(quantity->unit);
  if (!unit) return std::nullopt;
  const double ns = quantity->number * *unit;
  if (!(ns >= 0 && ns <= static_cast<double>(longest.ns()))) return std::nullopt;
  return std::llround(ns);
}

/// Six significant digits at most, without zeros behind.
std::string short_number(double value) { return fmt::format("{:.4g}", value); }

}  // namespace

std::optional<Duration> duration_of(std::string_view text, Duration longest) {
  const std::optional<std::int64_t> ns = to_ns(text, longest);
  if (!ns) return std::nullopt;
  return Duration::nanoseconds(*ns);
}

Result<Duration> parse_duration(std::string_view text) {
  const auto duration = duration_of(text, kLongestDuration);
  if (!duration) {
    return bad(
        "duration", text,
        fmt::format("a number and its unit, such as 8ms or 5s; the units are {}; a day at most", kDurationUnits));
  }
  return *duration;
}

Result<Exposure> parse_exposure(std::string_view text) {
  constexpr Duration kLongestExposure = kLongestDuration;
  constexpr std::int64_t kMinExposure = 1000;  // ns; a rig counts microseconds
  constexpr std::string_view kAllowed = "8ms, 500us, or a fraction of a second such as 1/125; it is 1us or more";
  if (const std::size_t slash = text.find('/'); slash != std::string_view::npos) {
    std::string_view below = text.substr(slash + 1);
    if (below.ends_with('s')) below.remove_suffix(1);
    const auto numerator = whole<std::uint32_t>(text.substr(0, slash));
    const auto denominator = whole<std::uint32_t>(below);
    if (!numerator || !denominator || *numerator == 0 || *denominator == 0) return bad("exposure", text, kAllowed);
    const double ns = std::round(1e9 * *numerator / *denominator);
    if (ns < kMinExposure || ns > static_cast<double>(kLongestExposure.ns())) return bad("exposure", text, kAllowed);
    return Exposure::of(Duration::nanoseconds(static_cast<std::int64_t>(ns)));
  }
  // "8m" is a slip for 8ms rather than eight minutes.
  const bool minutes = text.ends_with('m');
  const std::optional<std::int64_t> ns = to_ns(text, kLongestExposure);
  if (!ns || *ns < kMinExposure || minutes) return bad("exposure", text, kAllowed);
  return Exposure::of(Duration::nanoseconds(*ns));
}

Result<Gain> parse_gain(std::string_view text) {
  const std::optional<Quantity> quantity = split(text.starts_with('+') ? text.substr(1) : text);
  if (!quantity || (quantity->unit != "dB" && quantity->unit != "db") || std::abs(quantity->number) > 100) {
    return bad("gain", text, "decibels, such as 6dB or -3.5dB; 6.02dB is one stop");
  }
  return Gain::millidecibels(static_cast<std::int32_t>(std::lround(quantity->number * 1000)));
}

Result<WhiteBalance> parse_white_balance(std::string_view text) {
  constexpr std::string_view kAllowed = "red,blue against green, each 0.0625 to 15.99: 1.5,1.25";
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos) return bad("white balance", text, kAllowed);
  std::array<std::uint16_t, 2> q12{};
  const std::array<std::string_view, 2> parts{text.substr(0, comma), text.substr(comma + 1)};
  for (std::size_t i = 0; i < 2; ++i) {
    const std::optional<Quantity> factor = split(parts[i]);
    if (!factor || !factor->unit.empty()) return bad("white balance", text, kAllowed);
    const double scaled = std::round(factor->number * 4096);
    if (scaled < 256 || scaled > 65535) return bad("white balance", text, kAllowed);
    q12[i] = static_cast<std::uint16_t>(scaled);
  }
  return WhiteBalance{q12[0], q12[1]};
}

Result<std::uint32_t> parse_gamma(std::string_view text) {
  if (text == "own") return 0U;
  const std::optional<Quantity> gamma = split(text);
  if (!gamma || !gamma->unit.empty() || gamma->number < 0.1 || gamma->number > 8) {
    return bad("gamma", text, "a number 0.1 to 8, such as 2.2, or `own`");
  }
  return static_cast<std::uint32_t>(std::lround(gamma->number * 1000));
}

Result<std::uint32_t> parse_stops(std::string_view text) {
  const std::optional<Quantity> stops = split(text);
  if (!stops || !stops->unit.empty() || stops->number < 0 || stops->number > 8) {
    return bad("stops", text, "a number 0 to 8, such as 2.5; a stop is twice the light");
  }
  return static_cast<std::uint32_t>(std::lround(stops->number * 1000));
}

Result<FrameRate> parse_rate(std::string_view text) {
  const std::string allowed = fmt::format("30000/1001, 29.97, 25 or 12.5: {}", kFrameRatesAllowed);
  std::optional<FrameRate> rate;
  if (const std::size_t slash = text.find('/'); slash != std::string_view::npos) {
    const auto numerator = whole<std::uint32_t>(text.substr(0, slash));
    const auto denominator = whole<std::uint32_t>(text.substr(slash + 1));
    if (numerator && denominator) rate = FrameRate::make(*numerator, *denominator);
  } else if (text == "23.976" || text == "23.98") {
    rate = FrameRate{24000, 1001};
  } else if (text == "29.97") {
    rate = FrameRate{30000, 1001};
  } else if (text == "59.94") {
    rate = FrameRate{60000, 1001};
  } else if (const auto number = split(text);
             number && number->unit.empty() && number->number > 0 && number->number <= FrameRate::kFastest) {
    rate = FrameRate::make(static_cast<std::uint64_t>(std::llround(number->number * 1000)), 1000);
  }
  if (!rate) return bad("rate", text, allowed);
  return *rate;
}

std::string counted(std::uint64_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string show_duration(std::uint64_t ns) {
  const auto value = static_cast<double>(ns);
  if (ns < 1'000) return fmt::format("{} ns", ns);
  if (value < 999.95e3) return short_number(value / 1e3) + " µs";
  if (value < 999.95e6) return short_number(value / 1e6) + " ms";
  if (ns < 60'000'000'000ULL) return short_number(value / 1e9) + " s";
  const std::uint64_t seconds = ns / 1'000'000'000;
  if (seconds < 3600) return fmt::format("{} min {:02} s", seconds / 60, seconds % 60);
  return fmt::format("{} h {:02} min", seconds / 3600, seconds / 60 % 60);
}

std::string show_exposure(std::uint64_t ns) { return ns == 0 ? "unknown" : show_duration(ns); }

std::string show_gain(std::int32_t mdb) { return fmt::format("{:.2f} dB", mdb / 1000.0); }

std::string show_white_balance(std::uint32_t red_q12, std::uint32_t blue_q12) {
  return fmt::format("{:.2f}, {:.2f}", red_q12 / 4096.0, blue_q12 / 4096.0);
}

std::string show_rate(std::uint32_t millihertz) {
  return fmt::format("{:.{}f}", millihertz / 1000.0, millihertz > 0 && millihertz < 100 ? 3 : 2);
}

std::string show_bytes(std::uint64_t bytes) {
  const auto value = static_cast<double>(bytes);
  if (bytes < 1'000) return fmt::format("{} B", bytes);
  if (value < 999.95e3) return fmt::format("{:.1f} kB", value / 1e3);
  if (value < 999.95e6) return fmt::format("{:.1f} MB", value / 1e6);
  return fmt::format("{:.2f} GB", value / 1e9);
}

std::string show_id(const std::string& id_bytes) {
  if (id_bytes.empty()) return "none";
  std::string hex;
  for (const char byte : id_bytes.substr(0, 6)) hex += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return hex;
}

std::string show_deviation(double value, std::string_view unit) {
  if (!std::isfinite(value)) return "?";
  return value == 0 ? std::string("fixed") : fmt::format("{:.2g}{}", value, unit);
}

}  // namespace nodal::host
