// How well each head shows the pixels of the small map on which seams are placed.
#pragma once

#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::table {

/// For each head of the calibration: of every pixel of an equirectangular map, row by row, its score (head_weight.h),
/// or 0 where the head must not show the pixel: outside its region, or so close to the region's edge that a ramp would
/// reach beyond it (kMarginPixels of the map), if another head is not as close to its own. Where all are that close,
/// the one with the best score keeps it.
/// Errors: those of RaySampler::make.
Result<std::vector<std::vector<float>>> seam_scores(const Calibration& calibration,
                                                    std::span<const PixelFormat> head_formats,
                                                    PixelFormat raymap_format, int map_width);
inline constexpr double kMarginPixels = 2.5;

}  // namespace nodal::table
