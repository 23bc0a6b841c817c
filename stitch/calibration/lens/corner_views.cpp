#include "stitch/calibration/lens/corner_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace nodal::calibration {
namespace {

/// Corners about the board's centre, in units of its longer side; `sign` turns its y.
std::vector<PointPair> in_board_widths(std::vector<PointPair> corners, double sign) {
  Eigen::Vector2d least = corners.front().pattern, most = least;
  for (const PointPair& corner : corners) {
    least = least.cwiseMin(corner.pattern);
    most = most.cwiseMax(corner.pattern);
  }
  const double side = std::max((most - least).maxCoeff(), 1e-12);
  for (PointPair& corner : corners) {
    corner.pattern = (corner.pattern - (least + most) / 2) / side;
    corner.pattern.y() *= sign;
  }
  return corners;
}

}  // namespace

Result<std::vector<RadialPose>> poses_of_boards(const std::vector<CornerView>& views, const Eigen::Vector2d& center,
                                                double aspect, double tolerance_px) {
  std::string failed;
  for (const double sign : {1.0, -1.0}) {
    std::vector<RadialPose> poses;
    for (const CornerView& view : views) {
      auto pose = radial_pose(in_board_widths(view.corners, sign), center, aspect, tolerance_px);
      if (!pose) {
        if (failed.empty() || poses.size() > 0) failed = view.name;
        break;
      }
      poses.push_back(std::move(*pose));
    }
    if (poses.size() == views.size()) return poses;
  }
  return fail(Errc::kNotDetermined, fmt::format("{}: its corners are no picture of a flat board; check that "
                                                "each corner's place on the board is in the same row as its pixel",
                                                failed));
}

}  // namespace nodal::calibration
