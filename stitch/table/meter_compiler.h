// What the exposure meter reads: a coarse grid of rays, and where every head sees them.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/blend/meter.h"

namespace nodal::table {

inline constexpr int kMeterColumns = 64;  ///< of cells about the equator; rows are half as many

/// Cells lie on an equirectangular grid and count by the solid angle they span, so that a pixel counts by the sphere it
/// covers and the crowded rows at the poles weigh what they should. A cell is a head's where its middle is inside the
/// head's region.
///
/// Threading: thread-safe.
/// Errors: those of geometry::make_heads.
Result<blend::MeterTable> compile_meter_table(const Calibration& calibration);

}  // namespace nodal::table
