#include "stitch/blend/exposure_tone.h"

#include <algorithm>

namespace nodal::blend {
namespace {

/// Little where a head is clipped or black, never nothing: what all see so is still shown.
constexpr Confidence kTrust = [] {
  Confidence trust;
  constexpr int kFull = 232;  // mixed with a clipped neighbour, a sample is not yet full itself
  for (int level = 0; level < 256; ++level) {
    int value = 255;
    if (level < 4) value = 16 + 60 * level;
    if (level > kFull) value = std::max(1, 255 - (level - kFull) * 14);
    trust.of_level[static_cast<std::size_t>(level)] = static_cast<std::uint8_t>(value);
  }
  return trust;
}();

/// What light is shown as, once lifted by `scale`.
OutputCurve output_curve(const ToneTable& tones, std::uint16_t scale) {
  OutputCurve curve;
  const auto last = static_cast<std::int64_t>(tones.shown.size()) - 1;
  for (std::size_t i = 0; i < curve.knots.size(); ++i) {
    // Where in `shown` the knot's light lies, in 1 / 256 of its steps.
    const std::int64_t light = static_cast<std::int64_t>(512 * i) * scale / kScaleOne;
    const std::int64_t at = std::min(light * last * 256 / kMaxSample, last * 256);
    const auto low = static_cast<std::size_t>(at / 256);
    const std::int64_t from = tones.shown[low];
    const std::int64_t to = tones.shown[std::min(low + 1, static_cast<std::size_t>(last))];
    curve.knots[i] = static_cast<std::int16_t>(from + (to - from) * (at % 256) / 256);
  }
  return curve;
}

bool has_black(const BlendTable& table, std::size_t tone_class) {
  return std::any_of(table.components.begin(), table.components.end(), [&](const ComponentRule& rule) {
    return rule.tone == tone_class && rule.black != 0;
  });
}

void add_curves(const BlendTable& table, const ToneTable& tones, SetTone& tone) {
  for (std::size_t k = 0; k < kToneClasses; ++k) {
    if (has_black(table, k)) continue;  // of U and V gains are all there is
    for (std::size_t h = 0; h < table.sources.size(); ++h) tone.heads[h].curve[k] = tones.heads[h].curve;
    tone.output[k].curve = output_curve(tones, tone.output[k].scale);
  }
}

}  // namespace

SetTone tone_of_exposures(const BlendTable& table, const ToneTable& tones, std::span<const ExposedHead> heads) {
  const std::size_t count = std::min(table.sources.size(), tones.heads.size());
  if (count == 0) return calibrated_tone(table);
  std::int64_t sum = 0;
  Stops least = heads[0].exposure;
  Stops most = heads[0].exposure;
  for (std::size_t h = 0; h < count; ++h) {
    sum += heads[h].exposure;
    least = std::min(least, heads[h].exposure);
    most = std::max(most, heads[h].exposure);
  }
  if (most - least < kSameExposure) return calibrated_tone(table);
  const auto mean = static_cast<Stops>(sum / static_cast<std::int64_t>(count));
  std::array<std::array<std::uint16_t, kToneClasses>, kMaxHeads> gains{};
  for (std::size_t h = 0; h < count; ++h) {
    const std::int64_t by = heads[h].gamma == 0 ? tones.heads[h].exponent : (1 << 15) * 1000 / heads[h].gamma;
    const auto lift = static_cast<Stops>((mean - heads[h].exposure) * by / (1 << 15));
    for (std::size_t k = 0; k < kToneClasses; ++k) {
      const std::uint64_t gain = exp2_stops(lift, table.sources[h].gain[k]);
      gains[h][k] = static_cast<std::uint16_t>(std::clamp<std::uint64_t>(gain, 1, kMaxGain));
    }
  }
  SetTone tone = tone_of_gains(table, std::span(gains).first(count));
  if (!tones.shown.empty()) add_curves(table, tones, tone);
  if (most - least >= kTrustDifference) tone.confidence = kTrust;
  return tone;
}

}  // namespace nodal::blend
