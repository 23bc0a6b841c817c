// The weight of a head for a ray, before seams; and how fast it may change.
#pragma once

#include "stitch/geometry/head.h"
#include "stitch/table/head_optics.h"
#include "stitch/table/head_sight.h"

namespace nodal::table {

/// Rays closer than this to a region's edge (px) count as outside, so that the result does not depend on rounding.
inline constexpr double kEdge = 1e-6;
/// Densities from this on are excluded: at the lens's turning point, which only its outermost ray reaches, the density
/// is infinite.
inline constexpr double kEndless = 1e30;

/// Density times a factor that decreases towards the edges of the region.
double weight_of(const HeadSight& seen, bool seams, double depth_per_px);

/// The score of a head for seams (seam.h): the square root of its weight. A smoothstep rises with the square of the
/// distance from the edge, so its root is about linear.
double score_of(const HeadSight& seen, double depth_per_px);

/// An upper limit of the change of the head's score per radian, estimated from differences on a polar grid over its
/// region, with a margin. Infinite for heads with masks, towards which the score drops within few pixels.
double steepest_score(const geometry::Head& head, const HeadOptics& optics);

}  // namespace nodal::table
