// The lens that heads share, in units of radius: points to rays and back, with derivatives.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::autocalibration {

/// One lens for all heads; radii in units of each picture's Shape::unit().
struct SharedLens {
  KannalaBrandtLens model;
  double aspect = 1;            ///< height of a unit / its width, as in the calibration
  Eigen::Vector2d shift{0, 0};  ///< shift of the lens's axis from Shape::center(), units
};

/// The unknowns of a lens: log focal, k1, k2, log aspect, shift x, shift y.
inline constexpr int kLensUnknowns = 6;
enum LensUnknown : int { kLogFocal = 0, kFirstRadial = 1, kLogAspect = 3, kShift = 4 };

/// The ray of the head's frame that a point receives; nothing beyond the end of the lens.
class LensRays {
 public:
  /// Errors: kLensDomain, kBadValue for coefficients with which radii do not rise.
  static Result<LensRays> make(const SharedLens& lens);

  std::optional<Eigen::Vector3d> ray(const Eigen::Vector2d& at) const;
  /// The point that receives a ray of the head's frame, which has length 1.
  std::optional<Eigen::Vector2d> at(const Eigen::Vector3d& ray) const;

  struct RaySlopes {
    Eigen::Vector3d ray;
    Eigen::Matrix<double, 3, kLensUnknowns> by_lens;
  };
  std::optional<RaySlopes> ray_slopes(const Eigen::Vector2d& at) const;
  struct PointSlopes {
    Eigen::Vector2d at;
    Eigen::Matrix<double, 2, 3> by_ray;
    Eigen::Matrix<double, 2, kLensUnknowns> by_lens;
  };
  std::optional<PointSlopes> point_slopes(const Eigen::Vector3d& ray) const;

  /// Radius, units, of an angle from the axis, rad, and the reverse; nothing beyond the end of the lens.
  std::optional<double> radius(double angle) const;
  std::optional<double> angle(double radius) const;

 private:
  LensRays(geometry::Lens lens, const SharedLens& shared) : lens_(std::move(lens)), shared_(shared) {}
  geometry::Lens lens_;
  SharedLens shared_;
};

}  // namespace nodal::autocalibration
