// What is computed once per head for sampling its picture along rays.
#pragma once

#include <Eigen/Core>
#include <array>

#include "protocol/base/image.h"
#include "stitch/geometry/head.h"
#include "stitch/table/encoded_gain.h"
#include "stitch/table/options.h"
#include "stitch/table/tabled_lens.h"

namespace nodal::table {

struct HeadOptics {
  TabledLens lens;
  Eigen::Vector3d right, down, axis;  ///< axes of the head in the rig frame: the rows of R_head_rig
  double cos_reach = -1;              ///< rays with a smaller cosine to the axis are outside the region
  double depth_per_px = 1;  ///< 1 over the distance from an edge of the region where the weight has its full value
  EncodedGain undo;
  std::array<double, 3> gain{1, 1, 1};  ///< undoes the head's own gain, by ComponentRule::gain_row

  /// `power`: for raymaps of linear light, linear_power(); gains act on light^(1 / power).
  static HeadOptics of(const geometry::Head& head, PixelFormat raymap_format, double power,
                       const TableOptions& options);
};

/// The largest distance of a point of the region from the lens's centre, px.
double radius_of_region(const geometry::Head& head);

}  // namespace nodal::table
