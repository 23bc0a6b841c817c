// From double precision to the taps the board runs.
#pragma once

#include <span>
#include <vector>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// A gain about black as the table has it, 1 .. kMaxGain.
std::uint16_t quantize_gain(double gain);

/// Appends the taps of one raymap sample. Coordinates are rounded; weights are shared out by largest remainder,
/// so that they sum to exactly one, and a head whose share comes to nothing is left out. What lies exactly
/// between two steps goes up even when the last bits of a double say otherwise: sines and cosines differ in
/// those from one machine's library to the next, the table must not.
void append_taps(std::span<const RaySample> samples, const RaySampler& sampler, int grid,
                 std::vector<blend::Tap>& taps);

}  // namespace nodal::table
