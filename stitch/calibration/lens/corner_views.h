// Corners of a flat board that another program found in photographs.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/calibration/lens/start.h"

namespace nodal::calibration {

/// The corners of one photograph.
struct CornerView {
  std::string name;
  std::vector<PointPair> corners;  ///< pixels, and points of the board in any unit, its y downwards or upwards
};

/// A radial pose for each view, with the board's y downwards or, if that is a mirror image, upwards.
/// Errors: kNotDetermined, with the photograph's name.
Result<std::vector<RadialPose>> poses_of_boards(const std::vector<CornerView>& views, const Eigen::Vector2d& center,
                                                double aspect, double tolerance_px);

}  // namespace nodal::calibration
