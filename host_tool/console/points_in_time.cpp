#include "host_tool/console/points_in_time.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <ctime>
#include <optional>
#include <utility>

#include "host_tool/console/quantities.h"
#include "protocol/base/text.h"

namespace nodal::host {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr Duration kLongestAgo = Duration::seconds(std::int64_t{100} * 366 * 86400);

/// Takes a number of exactly `digits` digits.
std::optional<std::int64_t> take_number(std::string_view& text, std::size_t digits) {
  std::size_t length = 0;
  while (length < text.size() && text[length] >= '0' && text[length] <= '9') ++length;
  if (length != digits) return std::nullopt;
  std::int64_t number = 0;
  std::from_chars(text.data(), text.data() + length, number);
  text.remove_prefix(length);
  return number;
}

bool take(std::string_view& text, std::string_view allowed) {
  if (text.empty() || allowed.find(text.front()) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

/// Seconds since 1970 of a date with or without a time.
std::optional<std::int64_t> seconds_of_date(std::string_view text) {
  const auto year = take_number(text, 4);
  if (!year || !take(text, "-")) return std::nullopt;
  const auto month = take_number(text, 2);
  if (!month || !take(text, "-")) return std::nullopt;
  const auto day = take_number(text, 2);
  if (!day) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(static_cast<int>(*year)),
                                         std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok() || *year < 1970 || *year > 2200) return std::nullopt;
  const std::int64_t seconds = std::int64_t{std::chrono::sys_days(date).time_since_epoch().count()} * 86400;
  if (text.empty()) return seconds;
  if (!take(text, "T ")) return std::nullopt;
  const auto hour = take_number(text, 2);
  if (!hour || *hour > 23 || !take(text, ":")) return std::nullopt;
  const auto minute = take_number(text, 2);
  if (!minute || *minute > 59) return std::nullopt;
  std::optional<std::int64_t> second = 0;
  if (take(text, ":")) second = take_number(text, 2);
  if (!second || *second > 59) return std::nullopt;
  take(text, "Z");
  if (!text.empty()) return std::nullopt;
  return seconds + *hour * 3600 + *minute * 60 + *second;
}

}  // namespace

std::string show_utc(std::int64_t ns) {
  if (ns <= 0) return "unknown";
  return fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::gmtime(static_cast<std::time_t>(ns / kSecond)));
}

Result<std::int64_t> parse_point_in_time(std::string_view text, std::int64_t now_ns) {
  if (const auto ago = duration_of(text, kLongestAgo)) {
    if (now_ns > 0) return now_ns - ago->ns();
    return fail(Errc::kNotReady, "the rig's clock is not set, so no time can be counted back from now; give a date");
  }
  if (const auto date = seconds_of_date(text)) return *date * kSecond;
  return fail(Errc::kBadValue,
              fmt::format("'{}' is no time; allowed are a time ago, such as 90min or 3d (the units are {}), or a "
                          "date in UTC (2026-11-26, \"2026-11-26 12:30\")",
                          printable(text, 40), kDurationUnits));
}

}  // namespace nodal::host
