// The blend parameters of one frame set, computed from its exposures: how samples become light, how much confidence
// each sample gets, and how light becomes levels again. Integers only; the same bytes on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/units.h"
#include "stitch/blend/blend_table.h"

namespace nodal::blend {

/// Samples are in 1/128 of a level; kMaxSample is level 255.
inline constexpr int kSampleBits = 7;
inline constexpr int kMaxSample = 255 << kSampleBits;
/// Gains are in 1/32768, 1 .. kMaxToneGain: below one, so that light always fits 16 bits. The head with the largest
/// gain is not lowered, all others are lowered relative to it, and OutputTone::scale raises all of them again.
inline constexpr int kToneGainBits = 15;
inline constexpr int kMaxToneGain = 32767;
/// The value of OutputTone::scale that means one. The scale is at most 32767, seven stops.
inline constexpr int kScaleOne = 256;

/// Piecewise linear over samples: knots[i] is the value at sample 1024 i, 0 .. kMaxSample. The last knot is beyond all
/// samples and may be larger, so that the value at kMaxSample can be kMaxSample. In between
///   k + ((knots[i + 1] - k) * 32 * (sample mod 1024) + 2^14 >> 15),  k = knots[i], i = sample / 1024
struct ToneCurve {
  std::array<std::uint16_t, 33> knots{};
  friend bool operator==(const ToneCurve&, const ToneCurve&) = default;
};

/// Piecewise linear over light: knots[i] is the sample that light 512 i is shown as, 0 .. kMaxSample. The same formula
/// with steps of 512 (and 64 instead of 32).
struct OutputCurve {
  std::array<std::int16_t, 65> knots{};
  friend bool operator==(const OutputCurve&, const OutputCurve&) = default;
};

/// Tone classes (ComponentRule::tone): R G B are 0 1 2; Y is 0, U and V are 1; GREY is 0.
inline constexpr int kToneClasses = 3;

/// From samples to light, for one head in one set, by tone class:
///   light = (curve(sample) - black) * vignetting gain * gain
struct HeadTone {
  std::array<std::optional<ToneCurve>, kToneClasses> curve{};  ///< nothing: the sample itself
  std::array<std::uint16_t, kToneClasses> gain{kMaxToneGain, kMaxToneGain, kMaxToneGain};
};

/// From light to levels, for one tone class: level = black + light * scale, or, if there is a curve,
/// level = curve(light). Only a class whose black is 0 may have a curve.
struct OutputTone {
  std::uint16_t scale = kScaleOne;
  std::optional<OutputCurve> curve;
};

/// The confidence in a head's samples, 0 .. 255, by the level (sample / 128) of luma, or of the largest of R G B. A
/// head's weight is multiplied by it, and the weights of a pixel are normalized to sum to one again. So where heads
/// overlap, an unclipped head outweighs a clipped one. A pixel for which every head's confidence is 0 is black: use at
/// least 1 where the pixel should still be shown.
struct Confidence {
  std::array<std::array<std::uint8_t, 256>, kMaxHeads> of_level{};  ///< by head
};

/// The factor for a raymap's chroma by the level of its luma (the mean of the chroma sample's 2x2 luma samples), in
/// 1/256, at most kScaleOne: where the luma curve compresses highlights, it reduces their colour by the same factor.
struct ChromaFade {
  std::array<std::uint16_t, 256> of_luma{};
};

/// The parameters of a set's blend. Parts that are not used cost nothing; confidence makes the blend of tiles
/// that several heads share several times slower.
struct SetTone {
  std::array<HeadTone, kMaxHeads> heads{};
  std::array<OutputTone, kToneClasses> output{};
  std::optional<Confidence> confidence;
  std::optional<ChromaFade> fade;  ///< only for raymaps with chroma
  /// Whether gains are applied. False requires that every gain is kMaxToneGain, and it then means exactly one.
  bool gains = false;
};

/// The tone that multiplies head h's light by gains[h][tone class] / 4096 (1 .. 32767) and does nothing else. Gains are
/// divided by the largest; the output's scale multiplies by it again, and also undoes the division by vignetting_scale
/// in the table's vignetting gains. `gains` has one entry per head of the table.
SetTone tone_of_gains(const BlendTable& table, std::span<const std::array<std::uint16_t, kToneClasses>> gains);

/// The same for gains in 1 / 2^24, below 8.
inline constexpr int kFineGainBits = 24;
SetTone tone_of_fine_gains(const BlendTable& table, std::span<const std::array<std::uint32_t, kToneClasses>> gains);

/// The tone of heads whose exposures are the calibrated ones: tone_of_gains of BlendTable::Source::gain.
SetTone calibrated_tone(const BlendTable& table);

}  // namespace nodal::blend
