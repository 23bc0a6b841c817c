// The heads' response curves as integers for the board.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::table {

/// For raymaps of a format. `soft`: ToneTable's.
///
/// Threading: thread-safe. Errors: none; the calibration has been checked.
blend::ToneTable compile_tone_table(const Calibration& calibration, PixelFormat raymap, bool soft = true);

/// The p of light^(1 / p), in which heads are blended for raymaps of linear light: their own numbers, where all of them
/// have the same gamma; light itself (p = 1), where curves convert to it.
double linear_power(const Calibration& calibration);
/// BlendTable::linear.
std::vector<std::uint16_t> linear_numbers(double power);

}  // namespace nodal::table
