#include "stitch/blend/exposure_tone.h"

#include <algorithm>

namespace nodal::blend {
namespace {

/// A head's confidence by level: full between black and `full`, low outside. Where all heads clip, the shortest
/// exposure gives the best lower bound; where all are black, the longest exposure gives the best upper bound.
void trust(int full, int clipped, Stops above_darkest, Stops below_brightest, std::array<std::uint8_t, 256>& of_level) {
  const int floor = std::max(1, 64 >> std::min(6, 2 * above_darkest / kStop));
  for (int level = 0; level < 256; ++level) {
    int value = 255;
    if (level < 4 && below_brightest >= kTrustDifference) value = 16 + 60 * level;
    if (level > full) value = std::max(floor, 255 - 255 * (level - full) / (clipped - full));
    of_level[static_cast<std::size_t>(level)] = static_cast<std::uint8_t>(value);
  }
}

/// The sample that is shown for a sample of light^(1 / 2.2), given in 1/256 of a sample.
std::int64_t shown_at(const ToneTable& tones, std::int64_t sample) {
  if (tones.shown.empty()) return std::min<std::int64_t>(sample / 256, kMaxSample);
  const auto last = static_cast<std::int64_t>(tones.shown.size()) - 1;
  const std::int64_t at = std::min(sample * last / kMaxSample, last * 256);
  const auto low = static_cast<std::size_t>(at / 256);
  const std::int64_t from = tones.shown[low];
  const std::int64_t to = tones.shown[std::min(low + 1, static_cast<std::size_t>(last))];
  return from + (to - from) * (at % 256) / 256;
}

/// The curve from light to shown samples; light is first multiplied by `scale`, and then never exceeds `top`.
OutputCurve output_curve(const ToneTable& tones, std::uint16_t scale, std::int64_t top) {
  OutputCurve curve;
  for (std::size_t i = 0; i < curve.knots.size(); ++i) {
    const std::int64_t lifted = static_cast<std::int64_t>(512 * i) * scale;  // light * scale, in 1/256 of a sample
    const std::int64_t held = tones.soft ? soften(lifted, top * 256, kMaxSample * 256) : lifted;
    curve.knots[i] = static_cast<std::int16_t>(shown_at(tones, held));
  }
  return curve;
}

/// How much chroma remains at each shown level of luma.
ChromaFade fade_of(const ToneTable& tones, std::int64_t top) {
  ChromaFade fade;
  std::int64_t lifted = 0;
  for (std::size_t level = 0; level < fade.of_luma.size(); ++level) {
    const auto wanted = static_cast<std::int64_t>(level << kSampleBits);
    while (lifted < top && shown_at(tones, soften(lifted, top, kMaxSample) * 256) < wanted) lifted += 16;
    const std::int64_t held = soften(lifted, top, kMaxSample);
    fade.of_luma[level] = static_cast<std::uint16_t>(lifted == 0 ? kScaleOne : held * kScaleOne / lifted);
  }
  return fade;
}

bool has_black(const BlendTable& table, std::size_t tone_class) {
  return std::any_of(table.components.begin(), table.components.end(),
                     [&](const ComponentRule& rule) { return rule.tone == tone_class && rule.black != 0; });
}

/// `top`: the largest value to which a sample can be raised.
void add_curves(const BlendTable& table, const ToneTable& tones, std::int64_t top, SetTone& tone) {
  const bool bent = tones.soft && top > kMaxSample;
  if (tones.shown.empty() && !bent) return;
  for (std::size_t k = 0; k < kToneClasses; ++k) {
    if (has_black(table, k)) {  // U and V have gains, but no curves
      if (bent) tone.fade = fade_of(tones, top);
      continue;
    }
    for (std::size_t h = 0; h < table.sources.size(); ++h) tone.heads[h].curve[k] = tones.heads[h].curve;
    tone.output[k].curve = output_curve(tones, tone.output[k].scale, top);
  }
}

}  // namespace

std::optional<Confidence> confidence_of(std::span<const ExposedHead> heads, bool by_luma) {
  const auto [least, most] = std::ranges::minmax(heads, {}, &ExposedHead::exposure);
  if (most.exposure - least.exposure < kTrustDifference) return std::nullopt;
  std::optional<Confidence> confidence(std::in_place);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Stops exposure = heads[h].exposure;
    // Luma alone does not show that red or blue is clipped: at a luma of 168, a component that is half as strong again
    // clips. With colours, the limit is below 255 because interpolation mixes clipped samples with darker neighbours.
    trust(by_luma ? 168 : 232, by_luma ? 240 : 250, exposure - least.exposure, most.exposure - exposure,
          confidence->of_level[h]);
  }
  return confidence;
}

std::int64_t soften(std::int64_t value, std::int64_t top, std::int64_t full) {
  const std::int64_t from = full * kSoftFromPercent / 100;
  if (value <= from || top <= full) return std::min(value, full);
  const std::int64_t width = full - from;
  const std::int64_t above = std::min(value, top) - from;
  const std::int64_t most = top - from;
  // t (1 + t / T^2) / (1 + t) with t = above / width, T = most / width; ordered so that every step fits 64 bits.
  const std::int64_t bent = above + above * width / most * above / most;
  return from + bent * width / (width + above);
}

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
  Stops most_lift = 0;
  for (std::size_t h = 0; h < count; ++h) {
    const std::int64_t by = heads[h].gamma == 0 ? tones.heads[h].exponent : (1 << 15) * 1000 / heads[h].gamma;
    const auto lift = static_cast<Stops>((mean - heads[h].exposure) * by / (1 << 15));
    most_lift = std::max(most_lift, lift);
    for (std::size_t k = 0; k < kToneClasses; ++k) {
      const std::uint64_t gain = exp2_stops(lift, table.sources[h].gain[k]);
      gains[h][k] = static_cast<std::uint16_t>(std::clamp<std::uint64_t>(gain, 1, kMaxGain));
    }
  }
  SetTone tone = tone_of_gains(table, std::span(gains).first(count));
  const auto top = static_cast<std::int64_t>(exp2_stops(std::min(most_lift, 3 * kStop), kMaxSample));
  add_curves(table, tones, top, tone);
  tone.confidence = confidence_of(heads.first(count), has_black(table, 1));
  return tone;
}

}  // namespace nodal::blend
