#include "stitch/blend/linear_tone.h"

#include <algorithm>

namespace nodal::blend {
namespace {

/// Converts stops of light to stops of values that are light^(exponent / 2^15), and back.
Stops in_numbers(Stops stops, std::uint16_t exponent) {
  return static_cast<Stops>((std::int64_t{stops} * exponent + (1 << 14)) >> 15);
}
Stops in_light(Stops stops, std::uint16_t exponent) {
  return static_cast<Stops>(std::int64_t{stops} * (1 << 15) / std::max<std::int64_t>(1, exponent));
}

Stops least_of(std::span<const ExposedHead> heads) {
  return std::ranges::min(heads, {}, &ExposedHead::exposure).exposure;
}

Stops mean_of(std::span<const ExposedHead> heads) {
  std::int64_t sum = 0;
  for (const ExposedHead& head : heads) sum += head.exposure;
  return static_cast<Stops>(sum / static_cast<std::int64_t>(heads.size()));
}

/// The curve that converts values of light^(1000 / gamma) to light^(exponent / 2^15).
ToneCurve from_gamma(std::int32_t gamma, std::uint16_t exponent) {
  ToneCurve curve;
  const Stops full = log2_stops(kMaxSample);
  for (std::size_t i = 1; i < curve.knots.size(); ++i) {
    const Stops light = static_cast<Stops>(std::int64_t{log2_stops(1024 * i) - full} * gamma / 1000);
    const std::uint64_t number = exp2_stops(in_numbers(light, exponent), kMaxSample);
    curve.knots[i] = static_cast<std::uint16_t>(std::min<std::uint64_t>(number, 65535));
  }
  return curve;
}

bool is_gamma(std::int32_t gamma, std::uint16_t exponent) {
  return std::abs(std::int64_t{gamma} * exponent - std::int64_t{1000} * (1 << 15)) < exponent;  // within a thousandth
}

/// The light that is shown as `sample`, in 1 / kWhite of white.
std::uint64_t light_shown_as(const ToneTable& tones, std::int64_t sample) {
  const auto level = static_cast<std::size_t>(sample >> kSampleBits);
  if (level + 1 >= tones.shown_light.size()) return tones.shown_light.back();
  const std::uint64_t from = tones.shown_light[level];
  const std::uint64_t rise = tones.shown_light[level + 1] - from;
  return from + (rise * static_cast<std::uint64_t>(sample & ((1 << kSampleBits) - 1)) >> kSampleBits);
}

/// The smallest sample that soften() maps to at least `held`.
std::int64_t before_softening(std::int64_t held, std::int64_t top) {
  if (soften(held, top, kMaxSample) == held) return held;
  std::int64_t low = held;
  std::int64_t high = top;
  while (low < high) {
    const std::int64_t middle = (low + high) / 2;
    if (soften(middle, top, kMaxSample) >= held) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

}  // namespace

SetTone linear_tone(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads) {
  const std::size_t count = std::min({table.sources.size(), tones.heads.size(), heads.size()});
  if (count == 0) return calibrated_tone(table);
  const Stops least = least_of(heads.first(count));
  std::array<std::array<std::uint32_t, kToneClasses>, kMaxHeads> gains{};
  for (std::size_t h = 0; h < count; ++h) {
    const Stops lift = in_numbers(least - heads[h].exposure, tones.heads[h].exponent);  // zero or negative
    for (std::size_t k = 0; k < kToneClasses; ++k) {
      const std::uint64_t one = std::uint64_t{table.sources[h].gain[k]} << (kFineGainBits - kGainBits);
      gains[h][k] = static_cast<std::uint32_t>(std::max<std::uint64_t>(1, exp2_stops(lift, one)));
    }
  }
  SetTone tone = tone_of_fine_gains(table, std::span(gains).first(count));
  for (std::size_t h = 0; h < count; ++h) {
    const ToneTable::Head& head = tones.heads[h];
    std::optional<ToneCurve> curve = head.curve;
    if (heads[h].gamma != 0) {
      curve = is_gamma(heads[h].gamma, head.exponent) ? std::nullopt
                                                      : std::optional(from_gamma(heads[h].gamma, head.exponent));
    }
    tone.heads[h].curve.fill(curve);
  }
  tone.confidence = confidence_of(heads.first(count), false);
  return tone;
}

LinearScale linear_scale(const ToneTable& tones, const SetTone& tone, std::span<const ExposedHead> heads) {
  LinearScale scale;
  const std::size_t count = std::min(tones.heads.size(), heads.size());
  if (count == 0 || tones.shown_light.empty()) {
    for (std::size_t level = 1; level < 256; ++level)
      scale.shown_from[level] = static_cast<std::uint16_t>(257 * level - 128);
    return scale;
  }
  const Stops least = least_of(heads.first(count));
  const Stops mean = mean_of(heads.first(count));
  const Stops full =
      least - in_light(log2_stops(tone.output[0].scale) - log2_stops(kScaleOne), tones.heads[0].exponent);
  const std::uint64_t white = exp2_stops(full - mean, std::uint64_t{65535} << 8);  // the number for white, in 1 / 256
  scale.full = full;
  // Highlights are compressed in values of gamma 2.2, as in 8-bit raymaps.
  const Stops above = std::min<Stops>((mean - least) * 10 / 22, 3 * kStop);
  const auto top = static_cast<std::int64_t>(exp2_stops(above, kMaxSample));
  for (std::size_t level = 1; level < 256; ++level) {
    const auto held = static_cast<std::int64_t>((level << kSampleBits) - (1 << kSampleBits) / 2);
    const std::int64_t sample = tones.soft && top > kMaxSample ? before_softening(held, top) : held;
    const std::uint64_t number = (white * light_shown_as(tones, sample) / ToneTable::kWhite + 255) >> 8;
    scale.shown_from[level] = static_cast<std::uint16_t>(std::min<std::uint64_t>(number, 65535));
  }
  return scale;
}

}  // namespace nodal::blend
