#include "stitch/media/gpmf/gyro.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <string_view>

#include "protocol/base/try.h"

namespace nodal::media {
namespace {

constexpr int kMaxDepth = 8;
constexpr double kMinHz = 10, kMaxHz = 50000;  // gyros have 200 to 3300

using Bytes = std::span<const std::uint8_t>;

std::uint32_t big_endian(Bytes bytes) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

/// One key with its value.
struct Item {
  std::string_view key{};
  char type = 0;         ///< 0: the value is items
  std::size_t size = 0;  ///< bytes of one structure
  std::size_t count = 0;
  Bytes value{};
};

/// The item at the start of `rest`, which is then behind it.
Result<Item> next_item(Bytes& rest) {
  if (rest.size() < 8) return fail(Errc::kTruncated, "GPMF ends within the head of an item");
  Item item;
  item.key = {reinterpret_cast<const char*>(rest.data()), 4};
  item.type = static_cast<char>(rest[4]);
  item.size = rest[5];
  item.count = big_endian(rest.subspan(6, 2));
  const std::size_t bytes = item.size * item.count, padded = (bytes + 3) / 4 * 4;
  rest = rest.subspan(8);
  if (padded > rest.size()) {
    return fail(Errc::kTruncated, fmt::format("GPMF: an item of {} bytes, but {} bytes follow", bytes, rest.size()));
  }
  item.value = rest.first(bytes);
  rest = rest.subspan(padded);
  return item;
}

Result<std::size_t> size_of(const Item& item) {
  switch (item.type) {
    case 's':
    case 'S': return std::size_t{2};
    case 'l':
    case 'L':
    case 'f': return std::size_t{4};
    default: return fail(Errc::kUnsupported, "GPMF: GYRO or SCAL has a type other than s, S, l, L and f");
  }
}

Result<std::vector<double>> numbers_of(const Item& item) {
  NODAL_TRY_ASSIGN(const std::size_t size, size_of(item));
  std::vector<double> numbers;
  numbers.reserve(item.value.size() / size);
  for (Bytes rest = item.value; rest.size() >= size; rest = rest.subspan(size)) {
    const std::uint32_t bits = big_endian(rest.first(size));
    if (item.type == 's') numbers.push_back(static_cast<std::int16_t>(bits));
    else if (item.type == 'l') numbers.push_back(static_cast<std::int32_t>(bits));
    else if (item.type == 'f') numbers.push_back(static_cast<double>(std::bit_cast<float>(bits)));
    else numbers.push_back(bits);
  }
  return numbers;
}

/// A stream: an item STRM's items up to GYRO, and what they say.
struct Stream {
  std::vector<double> scale{};
  std::optional<std::uint32_t> total{};
  bool degrees = false;
};

Result<GyroSamples> samples_of(const Item& gyro, const Stream& stream) {
  NODAL_TRY_ASSIGN(const std::size_t size, size_of(gyro));
  if (gyro.size != 3 * size) return fail(Errc::kUnsupported, "GPMF: GYRO does not have three numbers a sample");
  std::vector<double> scale = stream.scale;
  if (scale.size() == 1) scale.resize(3, scale[0]);
  if (scale.size() != 3) return fail(Errc::kBadValue, "GPMF: GYRO has no SCAL of one or three numbers before it");
  for (const double s : scale) {
    if (!std::isfinite(s) || s == 0) return fail(Errc::kBadValue, "GPMF: SCAL of GYRO is 0 or not finite");
  }
  const double unit = stream.degrees ? 3.14159265358979323846 / 180 : 1;
  NODAL_TRY_ASSIGN(const std::vector<double> numbers, numbers_of(gyro));
  GyroSamples samples{{}, stream.total};
  samples.rates.reserve(gyro.count);
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
    const std::array<double, 3> rate{numbers[i] / scale[0] * unit, numbers[i + 1] / scale[1] * unit,
                                     numbers[i + 2] / scale[2] * unit};
    if (!std::ranges::all_of(rate, [](double x) { return std::abs(x) < 1e6; })) {
      return fail(Errc::kBadValue, "GPMF: GYRO has a rate of rotation that cannot be");
    }
    samples.rates.push_back(rate);
  }
  return samples;
}

/// The first GYRO in `rest`; nothing if there is none.
Result<std::optional<GyroSamples>> find_gyro(Bytes rest, int depth) {
  if (depth > kMaxDepth) return fail(Errc::kBadFormat, "GPMF: items are nested too deeply");
  Stream stream;
  // Zeros may follow the last item.
  while (!rest.empty() && !(rest.size() >= 4 && big_endian(rest.first(4)) == 0)) {
    NODAL_TRY_ASSIGN(const Item item, next_item(rest));
    if (item.type == 0) {
      NODAL_TRY_ASSIGN(auto found, find_gyro(item.value, depth + 1));
      if (found) return found;
    } else if (item.key == "SCAL") {
      // Other streams may have types that GYRO never has.
      auto scale = numbers_of(item);
      stream.scale = scale ? *std::move(scale) : std::vector<double>{};
    } else if (item.key == "TSMP" && item.value.size() == 4) {
      stream.total = big_endian(item.value);
    } else if (item.key == "SIUN" && item.type == 'c') {
      const std::string_view unit(reinterpret_cast<const char*>(item.value.data()), item.value.size());
      stream.degrees = unit.starts_with("deg/s");
    } else if (item.key == "GYRO") {
      NODAL_TRY_ASSIGN(GyroSamples samples, samples_of(item, stream));
      return samples;
    }
  }
  return std::nullopt;
}

/// One payload's place in the film.
struct Place {
  double time = 0;
  double before = 0;  ///< samples of the film before it
};

/// Time = start + interval * number of the sample.
struct TimeBase {
  double start = 0, interval = 0;
};

TimeBase time_base(const std::vector<Place>& places, double samples, double duration) {
  if (places.size() < 3) return {places[0].time, duration / samples};
  const double count = static_cast<double>(places.size());
  double time = 0, before = 0;
  for (const Place& p : places) time += p.time / count, before += p.before / count;
  double products = 0, squares = 0;
  for (const Place& p : places) {
    products += (p.before - before) * (p.time - time);
    squares += (p.before - before) * (p.before - before);
  }
  const double interval = products / squares;
  return {time - interval * (before - places[0].before), interval};
}

}  // namespace

Result<GyroSamples> read_gyro(std::span<const std::uint8_t> payload) {
  NODAL_TRY_ASSIGN(auto found, find_gyro(payload, 0));
  if (!found) return fail(Errc::kMissingField, "GPMF: no GYRO");
  return *std::move(found);
}

Result<Gyro> read_gyro(std::span<const TimedPayload> payloads) {
  std::vector<Place> places;
  std::vector<std::size_t> counts;
  Gyro gyro;
  double duration = 0;
  bool counted = true, missing = false;
  for (const TimedPayload& payload : payloads) {
    if (!std::isfinite(payload.time) || !std::isfinite(payload.duration)) {
      return fail(Errc::kBadValue, "GPMF: a payload's time is not finite");
    }
    auto samples = read_gyro(payload.bytes);
    if (!samples && samples.error().code == Errc::kMissingField) {
      missing = true;
      continue;
    }
    if (!samples) return fail(std::move(samples).error());
    const std::size_t count = samples->rates.size();
    if (count == 0) continue;
    const bool plausible = samples->total && *samples->total >= count;
    counted = counted && plausible;
    const double before = plausible ? static_cast<double>(*samples->total) - static_cast<double>(count) : 0;
    places.push_back({payload.time, before});
    counts.push_back(count);
    duration += payload.duration;
    for (const auto& w : samples->rates) gyro.speeds.push_back(std::hypot(w[0], w[1], w[2]));
  }
  if (places.empty()) return fail(Errc::kMissingField, "GPMF: no GYRO in any payload");
  for (std::size_t i = 1; counted && i < places.size(); ++i) {
    counted = places[i].before >= places[i - 1].before + static_cast<double>(counts[i - 1]);
  }
  if (!counted && missing) return fail(Errc::kMissingField, "GPMF: a payload without GYRO, and others without TSMP");
  if (!counted) places[0].before = 0;
  for (std::size_t i = 1; !counted && i < places.size(); ++i) {
    places[i].before = places[i - 1].before + static_cast<double>(counts[i - 1]);
  }
  const TimeBase base = time_base(places, static_cast<double>(gyro.speeds.size()), duration);
  if (!(base.interval >= 1 / kMaxHz) || !(base.interval <= 1 / kMinHz)) {
    return fail(Errc::kBadValue, "GPMF: times of payloads and numbers of GYRO samples give no rate of 10 to 50000 Hz");
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (std::size_t k = 0; k < counts[i]; ++k) {
      const double number = places[i].before - places[0].before + static_cast<double>(k);
      gyro.times.push_back(base.start + base.interval * number);
    }
  }
  return gyro;
}

}  // namespace nodal::media
