// The exposure meter's table: a coarse grid of rays, and their places in every head's picture.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/meter.h"

namespace nodal::table {

inline constexpr int kMeterColumns = 64;  ///< of cells about the equator; rows are half as many

/// Cells lie on an equirectangular grid and are weighted by their solid angle, so that the dense rows at the poles
/// get their proper weight. A cell belongs to a head when its middle is inside the
/// head's region.
///
/// Threading: thread-safe.
/// Errors: those of geometry::make_heads.
Result<blend::MeterTable> compile_meter_table(const Calibration& calibration);

}  // namespace nodal::table
