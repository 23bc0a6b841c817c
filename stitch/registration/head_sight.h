// A head's state as the kernel reads it.
#pragma once

#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// `planes` all have the same size, at the level where a pixel is `level_scale` full-size pixels. Rays closer than
/// `margin_px` (full-size) to the region's edge are not seen. The table must outlive the sight. The caller fills in the
/// channels.
HeadSight sight_of(const HeadState& head, const RadialTable& table, double used_angle,
                   const std::vector<PlaneRef>& planes, double level_scale, double margin_px);

}  // namespace nodal::registration
