// The heads' response curves as integers for the board.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/calibration.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::table {

/// The tone table for raymaps of format `raymap`. `soft`: ToneTable::soft.
///
/// Threading: thread-safe. Errors: none; the calibration has been checked.
blend::ToneTable compile_tone_table(const Calibration& calibration, PixelFormat raymap, bool soft = true);

/// For raymaps of linear light, heads are blended in values of light^(1 / p); this returns p. If all heads have the
/// same gamma, p is that gamma and their values are blended unchanged; else p is 1, and curves convert the values to
/// light.
double linear_power(const Calibration& calibration);
/// BlendTable::linear.
std::vector<std::uint16_t> linear_numbers(double power);

}  // namespace nodal::table
