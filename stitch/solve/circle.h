// The circle through points of an edge.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nodal::solve {

struct Circle {
  double x = 0, y = 0, radius = 0;

  /// The signed distance of a point; negative inside.
  double distance(const Eigen::Vector2d& p) const;
};

/// The least-squares circle through at least three points; linear in its centre and power. Not finite if they are on a
/// line.
Circle fitted_circle(const std::vector<Eigen::Vector2d>& points);

}  // namespace nodal::solve
