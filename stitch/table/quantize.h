// From double precision to the integers of the table.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// Rounds to the nearest integer. A value within kTie of the middle is rounded up: the last bits of sines and cosines
/// differ between machines' libraries, and the table must not.
inline std::int64_t round_up_ties(double value) {
  constexpr double kTie =
      1e-5;  // relative to the rounding step: far above the rounding noise of doubles, far below a visible error
  const double up = value + 0.5 + kTie;
  const auto whole = static_cast<std::int64_t>(up);
  return whole - (up < static_cast<double>(whole) ? 1 : 0);
}

/// A gain of a head as the table has it, 1 .. kMaxGain.
std::uint16_t quantize_gain(double gain);

/// A coordinate in 1 / (1 << kFractionBits) samples, such that it and its right neighbour are inside.
std::int32_t quantize_coordinate(double at, int size);

/// Shares 1 << kWeightBits out by largest remainder, so that the weights sum to exactly that; equal remainders by head,
/// so that three heads of a third each are the same three numbers everywhere. None of `samples` is zero weights.
void share_out(std::span<const RaySample> samples, std::array<std::uint16_t, kMaxHeads>& weights);

}  // namespace nodal::table
