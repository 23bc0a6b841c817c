// A frame set's exposures as parameters of its blend: how every head's samples become light, how much confidence each
// sample gets, and how light becomes levels again. Integers only; the same bytes on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/units.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Samples are in 1/128 levels: a pixel of 255, and what is mixed of such, is kMaxSample.
inline constexpr int kSampleBits = 7;
inline constexpr int kMaxSample = 255 << kSampleBits;
/// Gains are in 1/32768, 1 .. kMaxToneGain: below one, so that light never exceeds 16 bits. The head with the largest gain is
/// kept, all others are lowered, and OutputTone::scale raises all of them again.
inline constexpr int kToneGainBits = 15;
inline constexpr int kMaxToneGain = 32767;
/// OutputTone::scale of one; at most 32767, seven stops.
inline constexpr int kScaleOne = 256;

/// Piecewise linear over samples: knots[i] is the value at sample 1024 i, each 0 .. kMaxSample; the last lies beyond all
/// samples, and may be so much more that the value at kMaxSample is kMaxSample. In between
///   k + ((knots[i + 1] - k) * 32 * (sample mod 1024) + 2^14 >> 15),  k = knots[i], i = sample / 1024
struct ToneCurve {
  std::array<std::uint16_t, 33> knots{};
  friend bool operator==(const ToneCurve&, const ToneCurve&) = default;
};

/// Piecewise linear over light: knots[i] is the sample that light 512 i is shown as, each 0 .. kMaxSample, by the same
/// formula with steps of 512 (64 in place of 32).
struct OutputCurve {
  std::array<std::int16_t, 65> knots{};
  friend bool operator==(const OutputCurve&, const OutputCurve&) = default;
};

/// Tone classes (ComponentRule::tone): R G B are 0 1 2; Y is 0, U and V are 1; GREY is 0.
inline constexpr int kToneClasses = 3;

/// From samples to light, of one head in one set, by tone class:
///   light = (curve(sample) - black) * vignetting gain * gain
struct HeadTone {
  std::array<std::optional<ToneCurve>, kToneClasses> curve{};  ///< nothing: the sample itself
  std::array<std::uint16_t, kToneClasses> gain{kMaxToneGain, kMaxToneGain, kMaxToneGain};
};

/// From light to levels, of a tone class: level = black + light * scale, or where there is a curve, which only a class
/// whose black is 0 may have, level = curve(light).
struct OutputTone {
  std::uint16_t scale = kScaleOne;
  std::optional<OutputCurve> curve;
};

/// How far each head is to be trusted by what it saw, 0 .. 255 by the level (sample / 128) of its luma, or of the largest
/// of R G B: a head's weight is multiplied by it, and the weights of a raymap sample are made to sum to one again. So
/// where heads overlap, one that is not clipped outweighs one that is. Where it is 0 for every head that looks there,
/// the sample is black: keep 1 at least where something should be seen anyhow.
struct Confidence {
  std::array<std::array<std::uint8_t, 256>, kMaxHeads> of_level{};  ///< by head
};

/// What is left of a raymap's chroma by the level of its luma, in 1/256, at most kScaleOne: where luma's curve holds
/// highlights back, their colour is held back as much. Of the 2x2 luma samples of a chroma sample, their mean.
struct ChromaFade {
  std::array<std::uint16_t, 256> of_luma{};
};

/// The parameters of a set's blend. Parts that are not used cost nothing; confidence makes the blend of tiles
/// that several heads share several times slower.
struct SetTone {
  std::array<HeadTone, kMaxHeads> heads{};
  std::array<OutputTone, kToneClasses> output{};
  std::optional<Confidence> confidence;
  std::optional<ChromaFade> fade;  ///< of raymaps with chroma
  /// Whether gains act: false promises that every gain is kMaxToneGain and means exactly one.
  bool gains = false;
};

/// The tone that multiplies head h's light by gains[h][tone class] / 4096 (1 .. 32767), and no more: gains are divided
/// by the largest, and the output's scale, which also undoes what the table's vignetting gains were divided by, lifts
/// them again. One gain for every head of the table.
SetTone tone_of_gains(const BlendTable& table, std::span<const std::array<std::uint16_t, kToneClasses>> gains);

/// The same of gains in 1 / 2^24, below 8.
inline constexpr int kFineGainBits = 24;
SetTone tone_of_fine_gains(const BlendTable& table, std::span<const std::array<std::uint32_t, kToneClasses>> gains);

/// The tone of heads that are exposed as they were when calibrated: tone_of_gains of BlendTable::Source::gain.
SetTone calibrated_tone(const BlendTable& table);

}  // namespace nodal::blend
