// How heads' numbers follow light, as integers for the board.
#pragma once

#include "protocol/calibration.h"
#include "stitch/blend/exposure_tone.h"

namespace nodal::table {

/// `soft`: ToneTable's.
///
/// Threading: thread-safe. Errors: none; the calibration has been checked.
blend::ToneTable compile_tone_table(const Calibration& calibration, bool soft = true);

}  // namespace nodal::table
