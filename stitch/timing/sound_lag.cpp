#include "stitch/timing/sound_lag.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/timing/fourier.h"
#include "stitch/timing/peak.h"
#include "stitch/timing/robust_line.h"
#include "stitch/timing/sinc.h"

namespace nodal::timing {
namespace {

constexpr double kBandwidthHz = 3700;
constexpr double kMinOverlap = 9;  // s
constexpr double kFirstChunk = 3;  // s; at 300 ppm its lag changes by 0.9 ms
constexpr int kFirstChunks = 16, kMaxChunks = 60;
constexpr double kMinChunk = 3, kMaxChunk = 20;  // s
constexpr double kSigmas = 7;                    // a peak that chance does not make in 10^5 lags
constexpr double kSecondPeak = 0.8;              // share of the first: ambiguous
constexpr double kPeakWidth = 3e-3;              // s; closer peaks are echoes and side lobes of one
constexpr double kFirstTolerance = 2e-3, kTolerance = 0.3e-3, kMinScatter = 0.3e-6;  // s
constexpr int kMargin = 40;  // samples to each side of the line that are searched: 4 ms
constexpr double kMinShareOnLine = 0.7;

Result<std::vector<double>> piece(const SoundTrack& track, double from, double seconds) {
  const auto first = static_cast<std::int64_t>(std::llround((from - track.start()) * kBandRate));
  NODAL_TRY_ASSIGN(const std::vector<float> samples, track.samples(first, std::llround(seconds * kBandRate)));
  return std::vector<double>(samples.begin(), samples.end());
}

/// The samples of b that a chunk of a is compared with, at the places that the line says.
Result<std::vector<double>> resampled(const SoundTrack& b, const Lag& line, double begin, std::size_t count,
                                      const SincTable& sinc) {
  constexpr double kBeside = 64;  // samples; a value is made of 32
  const auto place = [&](double index) {
    const double time = begin + (index - kMargin) / kBandRate;
    return (time + line.value(time) - b.start()) * kBandRate;
  };
  const double low = std::floor(place(0) - kBeside), high = place(static_cast<double>(count)) + kBeside;
  const auto first = std::max<std::int64_t>(0, std::llround(low));
  NODAL_TRY_ASSIGN(const std::vector<float> samples, b.samples(first, std::llround(high) - first));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = sinc.value(std::span<const float>(samples), place(static_cast<double>(i)) - static_cast<double>(first));
  }
  return values;
}

bool is_silent(const std::vector<double>& samples) {
  const auto zeros = std::ranges::count(samples, 0.0);
  return 2 * static_cast<std::size_t>(zeros) > samples.size();
}

/// A microphone may be wired the other way round: the values, so that the largest magnitude is positive.
std::vector<double> upright(std::vector<double> values) {
  const auto [low, high] = std::ranges::minmax(values);
  if (-low > high) std::ranges::transform(values, values.begin(), std::negate<>());
  return values;
}

constexpr auto kPeakPlaces = static_cast<std::size_t>(kPeakWidth * kBandRate);

/// What the first chunks gave.
struct FirstLags {
  std::vector<LagPoint> points{};
  int silent = 0, ambiguous = 0, unlike = 0;
};

Result<FirstLags> first_lags(const SoundTrack& a, const SoundTrack& b, double from, double to, const Search& search) {
  FirstLags found;
  for (int i = 0; i < kFirstChunks; ++i) {
    const double at = from + (to - from - kFirstChunk) * i / (kFirstChunks - 1);
    NODAL_TRY_ASSIGN(const auto chunk, piece(a, at, kFirstChunk));
    const double b_from = std::max(b.start(), at + search.expected - search.reach);
    const double b_to = std::min(b.end(), at + kFirstChunk + search.expected + search.reach);
    NODAL_TRY_ASSIGN(const auto other, piece(b, b_from, b_to - b_from));
    if (chunk.empty() || other.size() < chunk.size() + kBandRate / 10) continue;
    if (is_silent(chunk) || is_silent(other)) {
      ++found.silent;
      continue;
    }
    const auto likeness = upright(correlation_coefficients(chunk, other));
    const Peak peak = highest_peak(likeness, kPeakPlaces);
    const double chance = std::max(chance_of(likeness), 1 / std::sqrt(2 * kBandwidthHz * kFirstChunk));
    if (peak.size < kSigmas * chance) ++found.unlike;
    else if (peak.second > kSecondPeak * peak.size) ++found.ambiguous;
    else {
      // Both pieces begin at a whole sample of their track.
      const double a_begin = std::max(0.0, std::round((at - a.start()) * kBandRate)) / kBandRate + a.start();
      const double b_begin = std::max(0.0, std::round((b_from - b.start()) * kBandRate)) / kBandRate + b.start();
      const double lag = b_begin + static_cast<double>(peak.at) / kBandRate - a_begin;
      found.points.push_back({at + kFirstChunk / 2, lag});
    }
  }
  return found;
}

/// The lag of one chunk of `a`, with `b` along `line`.
Result<std::optional<LagPoint>> chunk_lag(const SoundTrack& a, const SoundTrack& b, const Lag& line, double at,
                                          double seconds, const SincTable& sinc) {
  NODAL_TRY_ASSIGN(const auto chunk, piece(a, at, seconds));
  if (chunk.empty() || is_silent(chunk)) return std::nullopt;
  const double begin = std::round((at - a.start()) * kBandRate) / kBandRate + a.start();
  NODAL_TRY_ASSIGN(const auto other, resampled(b, line, begin, chunk.size() + 2 * kMargin, sinc));
  std::vector<double> likeness(2 * kMargin + 1);
  double norm_a = 0, norm_b = 0;
  for (std::size_t i = 0; i < chunk.size(); ++i)
    norm_a += chunk[i] * chunk[i], norm_b += other[i + kMargin] * other[i + kMargin];
  if (norm_a <= 0 || norm_b <= 0) return std::nullopt;
  for (std::size_t k = 0; k < likeness.size(); ++k) {
    double sum = 0;
    for (std::size_t i = 0; i < chunk.size(); ++i) sum += chunk[i] * other[i + k];
    likeness[k] = sum / std::sqrt(norm_a * norm_b);
  }
  likeness = upright(std::move(likeness));
  const Peak peak = highest_peak(likeness, kPeakPlaces);
  const double chance = 1 / std::sqrt(2 * kBandwidthHz * seconds);
  if (peak.size < kSigmas * chance || peak.at < 2 || peak.at + 3 > likeness.size()) return std::nullopt;
  const double middle = begin + seconds / 2;
  const double beside = (refined_peak(likeness, peak.at, sinc) - kMargin) / kBandRate;
  // b at time + line(time) + beside (1 + rate): the resampled b runs by a's clock.
  return LagPoint{middle, line.value(middle) + beside * (1 + line.rate)};
}

tl::unexpected<Error> why_not(const FirstLags& first) {
  const int heard = first.ambiguous + first.unlike + static_cast<int>(first.points.size());
  if (heard < 3) return fail(Errc::kNotDetermined, "the sound is silent");
  if (first.ambiguous > first.unlike)
    return fail(Errc::kNotDetermined, "the sound repeats (music, hum), so several lags fit it");
  return fail(Errc::kNotDetermined, "the two sounds have too little in common");
}

}  // namespace

Result<Lag> sound_lag(const SoundTrack& a, const SoundTrack& b, const Search& search) {
  const double from = std::max(a.start(), b.start() - search.expected - search.reach);
  const double to = std::min(a.end(), b.end() - search.expected + search.reach);
  const std::string shortness = "the films overlap by less than 9 s, too little for their sound";
  if (to - from < kMinOverlap) return fail(Errc::kNotDetermined, shortness);
  NODAL_TRY_ASSIGN(const FirstLags first, first_lags(a, b, from, to, search));
  const auto coarse = robust_line(first.points, {.tolerance = kFirstTolerance, .least_scatter = 0.3e-3});
  if (!coarse || first.ambiguous > static_cast<int>(first.points.size())) return why_not(first);
  if (coarse->used < kMinShareOnLine * static_cast<double>(first.points.size())) {
    return fail(Errc::kNotDetermined,
                "the lags of the sound are not on one line: a film was paused, or its sound was cut");
  }

  const SincTable sinc;
  Lag line = *coarse;
  for (int pass = 0; pass < 2; ++pass) {
    const double begin = std::max(a.start(), b.start() - line.lag) + 0.05,
                 end = std::min(a.end(), b.end() - line.lag) - 0.05;
    if (end - begin < kMinOverlap) return fail(Errc::kNotDetermined, shortness);
    const double seconds = std::clamp((end - begin) / 10, kMinChunk, kMaxChunk);
    const int chunks = std::clamp(static_cast<int>((end - begin) / seconds), 2, kMaxChunks);
    std::vector<LagPoint> points;
    for (int i = 0; i < chunks; ++i) {
      const double at = begin + (end - begin - seconds) * i / (chunks - 1);
      NODAL_TRY_ASSIGN(const auto point, chunk_lag(a, b, line, at, seconds, sinc));
      if (point) points.push_back(*point);
    }
    const auto fine = robust_line(points, {.tolerance = kTolerance, .least_scatter = kMinScatter});
    if (!fine) return fail(Errc::kNotDetermined, "the two sounds have too little in common");
    if (fine->used < kMinShareOnLine * static_cast<double>(points.size())) {
      return fail(Errc::kNotDetermined,
                  "the lags of the sound are not on one line: a film was paused, or its sound was cut");
    }
    // Within a chunk, an error of the line's rate smears the peak.
    const bool smeared = std::abs(fine->rate - line.rate) * seconds > 0.05e-3;
    line = *fine;
    line.measured = chunks;
    if (!smeared) break;
  }
  return line;
}

}  // namespace nodal::timing
