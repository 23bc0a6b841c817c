#include "stitch/view/camera_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

namespace nodal::view {
namespace {

/// The numbers of a key that change along a path.
std::array<double, 4> numbers_of(const CameraKey& key) {
  return {key.pose.yaw, key.pose.pitch, key.pose.roll, key.fov_deg};
}
CameraKey key_of(std::int64_t picture, const std::array<double, 4>& numbers) {
  return {picture, {numbers[0], numbers[1], numbers[2]}, numbers[3]};
}

/// The slope at a key between two pieces of lengths h0, h1 and slopes d0, d1: the harmonic mean, 0 at an extremum.
double slope_between(double h0, double d0, double h1, double d1) {
  if (d0 * d1 <= 0) return 0;
  const double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
  return (w0 + w1) / (w0 / d0 + w1 / d1);
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

template <class Number>
bool read_number(std::string_view text, Number& number) {
  text = trimmed(text);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

/// Nothing if the line is not five numbers, of which the first is whole.
std::optional<CameraKey> read_key(std::string_view line) {
  std::array<std::string_view, 5> fields;
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const std::size_t comma = line.find(',');
    if ((comma == std::string_view::npos) != (k + 1 == fields.size())) return std::nullopt;
    fields[k] = line.substr(0, comma);
    line.remove_prefix(std::min(line.size(), fields[k].size() + 1));
  }
  CameraKey key;
  const bool good = read_number(fields[0], key.picture) && read_number(fields[1], key.pose.yaw) &&
                    read_number(fields[2], key.pose.pitch) && read_number(fields[3], key.pose.roll) &&
                    read_number(fields[4], key.fov_deg);
  return good ? std::optional(key) : std::nullopt;
}

Status check(const CameraKey& key) {
  constexpr double kMaxTurned = 360'000;
  const auto within = [](double value, double most) { return std::abs(value) <= most; };
  if (key.picture < 0 || key.picture >= CameraPath::kMaxPictures)
    return fail(Errc::kBadValue, fmt::format("a picture is 0 to {}", CameraPath::kMaxPictures - 1));
  if (!within(key.pose.yaw, kMaxTurned) || !within(key.pose.roll, kMaxTurned))
    return fail(Errc::kBadValue, "yaw and roll are -360000 to 360000 degrees");
  if (!within(key.pose.pitch, 90)) return fail(Errc::kBadValue, "pitch is -90 to 90 degrees");
  if (!std::isfinite(key.fov_deg)) return fail(Errc::kBadValue, "the field of view is a number of degrees");
  return {};
}

}  // namespace

Result<CameraPath> CameraPath::parse(std::string_view text) {
  std::vector<CameraKey> keys;
  const auto wrong = [](std::size_t line, const std::string& what) {
    return fail(Errc::kBadValue, fmt::format("line {}: {}", line, what));
  };
  bool first = true;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(text.size(), end + 1));
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    const bool names = first && line == "picture,yaw,pitch,roll,fov";
    first = false;
    if (names) continue;
    const std::optional<CameraKey> key = read_key(line);
    if (!key) return wrong(number, "write picture,yaw,pitch,roll,fov, for example 0,-30,0,0,90");
    if (const Status good = check(*key); !good) return wrong(number, good.error().message);
    if (!keys.empty() && key->picture <= keys.back().picture)
      return wrong(number, fmt::format("picture {} is not after the one of the line before", key->picture));
    if (keys.size() == kMaxKeys) return fail(Errc::kTooLarge, fmt::format("a path has at most {} keys", kMaxKeys));
    keys.push_back(*key);
  }
  if (keys.empty()) return fail(Errc::kBadValue, "there is no key; write a line picture,yaw,pitch,roll,fov for each");
  return CameraPath(std::move(keys));
}

CameraPath::CameraPath(std::vector<CameraKey> keys) : keys_(std::move(keys)) {
  const auto length = [&](std::size_t k) { return static_cast<double>(keys_[k + 1].picture - keys_[k].picture); };
  const auto slope = [&](std::size_t k, std::size_t n) {
    return (numbers_of(keys_[k + 1])[n] - numbers_of(keys_[k])[n]) / length(k);
  };
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    std::array<double, 4> slopes{};  // 0 at the ends, where the camera rests
    for (std::size_t n = 0; n < slopes.size() && k > 0 && k + 1 < keys_.size(); ++n) {
      slopes[n] = slope_between(length(k - 1), slope(k - 1, n), length(k), slope(k, n));
    }
    slopes_.push_back(key_of(0, slopes));
  }
}

CameraKey CameraPath::at(std::int64_t picture) const {
  const auto next = std::ranges::upper_bound(keys_, picture, {}, &CameraKey::picture);
  if (next == keys_.begin() || next == keys_.end()) {
    return key_of(picture, numbers_of(next == keys_.begin() ? keys_.front() : keys_.back()));
  }
  const auto k = static_cast<std::size_t>(next - keys_.begin()) - 1;
  const double h = static_cast<double>(keys_[k + 1].picture - keys_[k].picture);
  const double t = static_cast<double>(picture - keys_[k].picture) / h;
  const std::array<double, 4> from = numbers_of(keys_[k]), to = numbers_of(keys_[k + 1]);
  const std::array<double, 4> begin = numbers_of(slopes_[k]), end = numbers_of(slopes_[k + 1]);
  std::array<double, 4> numbers{};
  for (std::size_t n = 0; n < numbers.size(); ++n) {  // Hermite's cubic
    numbers[n] =
        from[n] + t * t * (3 - 2 * t) * (to[n] - from[n]) + h * t * (1 - t) * ((1 - t) * begin[n] - t * end[n]);
    numbers[n] = std::clamp(numbers[n], std::min(from[n], to[n]), std::max(from[n], to[n]));  // against rounding
  }
  return key_of(picture, numbers);
}

}  // namespace nodal::view
