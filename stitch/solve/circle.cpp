#include "stitch/solve/circle.h"

#include <algorithm>
#include <cmath>

#include "stitch/solve/normal_equations.h"

namespace nodal::solve {

double Circle::distance(const Eigen::Vector2d& p) const { return std::hypot(p.x() - x, p.y() - y) - radius; }

Circle fitted_circle(const std::vector<Eigen::Vector2d>& points) {
  NormalEquations sum(3);
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector3d row(2 * p.x(), 2 * p.y(), 1);
    sum.add(row.data(), -p.squaredNorm(), 1);
  }
  const Eigen::Vector3d x = sum.step(0, {});
  return {x[0], x[1], std::sqrt(std::max(0.0, x[2] + x[0] * x[0] + x[1] * x[1]))};
}

}  // namespace nodal::solve
