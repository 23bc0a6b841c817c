// The ports that count frames by a rate, after pauses of any length.
#pragma once

#include <optional>

#include "protocol/base/bytes.h"
#include "protocol/base/units.h"
#include "telling.h"

namespace nodal::fuzz {

/// An allowed rate, or nothing.
inline std::optional<FrameRate> drawn_rate(ByteReader& in) {
  const std::uint32_t numerator = telling32(in), denominator = telling32(in);
  return FrameRate::make(numerator, denominator);
}

// Each starts a port at a rate drawn from the input, advances its clock by drawn durations, up to a hundred years in
// total, and asserts that the results equal exact arithmetic, in a bounded number of steps.
void check_sim_trigger(ByteReader& in);
void check_sim_head(ByteReader& in);
void check_replay_trigger(ByteReader& in);
void check_replay_head(ByteReader& in);

}  // namespace nodal::fuzz
