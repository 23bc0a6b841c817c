#include "stitch/blend/tone.h"

#include <algorithm>

namespace nodal::blend {

SetTone tone_of_fine_gains(const BlendTable& table, std::span<const std::array<std::uint32_t, kToneClasses>> gains) {
  constexpr std::uint32_t kOne = 1 << kFineGainBits;
  SetTone tone;
  std::uint32_t largest = kOne;
  bool any = table.vignetting_scale != kScaleOne;
  for (const auto& head : gains) {
    for (const std::uint32_t gain : head) {
      largest = std::max(largest, gain);
      any = any || gain != kOne;
    }
  }
  // The scale is a multiple of 1/256. It is rounded up first; gains are then divided by the rounded scale.
  const auto lift = static_cast<std::uint32_t>((std::uint64_t{largest} * 256 + kOne - 1) / kOne);
  const std::uint32_t scale = std::min<std::uint32_t>(32767, (lift * table.vignetting_scale + 255) / 256);
  for (OutputTone& output : tone.output) output.scale = static_cast<std::uint16_t>(scale);
  if (!any) return tone;
  tone.gains = true;
  // gain / kOne * vignetting_scale / scale, as 1 / 32768.
  const std::uint64_t divisor = std::uint64_t{scale} * kOne;
  for (std::size_t h = 0; h < gains.size(); ++h) {
    for (std::size_t k = 0; k < kToneClasses; ++k) {
      const std::uint64_t share = std::uint64_t{gains[h][k]} * table.vignetting_scale << kToneGainBits;
      tone.heads[h].gain[k] =
          static_cast<std::uint16_t>(std::clamp<std::uint64_t>((share + divisor / 2) / divisor, 1, kMaxToneGain));
    }
  }
  return tone;
}

SetTone tone_of_gains(const BlendTable& table, std::span<const std::array<std::uint16_t, kToneClasses>> gains) {
  std::array<std::array<std::uint32_t, kToneClasses>, kMaxHeads> fine{};
  for (std::size_t h = 0; h < gains.size(); ++h) {
    for (std::size_t k = 0; k < kToneClasses; ++k)
      fine[h][k] = std::uint32_t{gains[h][k]} << (kFineGainBits - kGainBits);
  }
  return tone_of_fine_gains(table, std::span(fine).first(gains.size()));
}

SetTone calibrated_tone(const BlendTable& table) {
  std::array<std::array<std::uint16_t, kToneClasses>, kMaxHeads> gains{};
  for (std::size_t h = 0; h < table.sources.size(); ++h) gains[h] = table.sources[h].gain;
  return tone_of_gains(table, std::span(gains).first(table.sources.size()));
}

}  // namespace nodal::blend
