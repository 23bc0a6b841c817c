// The exposure meter's table: a coarse grid of rays, and their places in every head's picture.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/meter.h"

namespace nodal::table {

inline constexpr int kMeterColumns = 64;  ///< cells around the equator; there are half as many rows

/// Cells lie on an equirectangular grid and are weighted by their solid angle, because rows near the poles have smaller
/// cells. A cell belongs to a head if its centre is inside the head's region.
///
/// Threading: thread-safe.
/// Errors: those of geometry::make_heads.
Result<blend::MeterTable> compile_meter_table(const Calibration& calibration);

}  // namespace nodal::table
