// The ports that count frames by a rate, after pauses of any length.
#pragma once

#include <optional>

#include "protocol/base/bytes.h"
#include "protocol/base/units.h"
#include "telling.h"

namespace nodal::fuzz {

/// One that is allowed, or nothing.
inline std::optional<FrameRate> drawn_rate(ByteReader& in) {
  const std::uint32_t numerator = telling32(in), denominator = telling32(in);
  return FrameRate::make(numerator, denominator);
}

// Each starts one at a rate drawn from the input, moves its clock on by lengths that are drawn, to a hundred years in
// all, and asserts that what came is what exact arithmetic says, in a bounded number of steps.
void check_sim_trigger(ByteReader& in);
void check_sim_head(ByteReader& in);
void check_replay_trigger(ByteReader& in);
void check_replay_head(ByteReader& in);

}  // namespace nodal::fuzz
