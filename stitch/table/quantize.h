// From double precision to the integers of the table.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// Rounds to the nearest integer. A value within kTie of the middle is rounded up, because the last bits of sines and
/// cosines differ between the machines' libraries, and the table must be the same on every machine.
inline std::int64_t round_up_ties(double value) {
  // Relative to the rounding step: far above the rounding noise of doubles, far below a visible error.
  constexpr double kTie = 1e-5;
  const double up = value + 0.5 + kTie;
  const auto whole = static_cast<std::int64_t>(up);
  return whole - (up < static_cast<double>(whole) ? 1 : 0);
}

/// Source::gain for the factor `gain`, 1 .. kMaxGain.
std::uint16_t quantize_gain(double gain);

/// A coordinate in 1 / (1 << kFractionBits) samples, clamped so that its sample and the next one are in 0 .. size - 1.
std::int32_t quantize_coordinate(double at, int size);

/// Converts weights to integers by the largest-remainder method, so that they sum to exactly 1 << kWeightBits. Equal
/// remainders go to the lower head first, so that three heads with a third each get the same three numbers on every
/// machine. If `samples` is empty, all weights are 0.
void share_out(std::span<const RaySample> samples, std::array<std::uint16_t, kMaxHeads>& weights);

}  // namespace nodal::table
