// The bundle adjustment of rotations and one lens that all heads share.
#pragma once

#include "stitch/autocalibration/arrangement.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::autocalibration {

/// A match's two points in units of radius, from Shape::center().
struct UnitMatch {
  std::size_t a = 0, b = 0;
  Eigen::Vector2d at_a, at_b;
};
std::vector<UnitMatch> in_units(const std::vector<Shape>& shapes, const std::vector<Match>& matches);

/// The ray of the head's frame that a point receives; nothing beyond the end of the lens.
class LensRays {
 public:
  /// Errors: kLensDomain, kBadValue for coefficients with which radii do not rise.
  static Result<LensRays> make(const SharedLens& lens);
  std::optional<Eigen::Vector3d> ray(const Eigen::Vector2d& at) const;
  /// The point that receives a ray of the head's frame, which has length 1.
  std::optional<Eigen::Vector2d> at(const Eigen::Vector3d& ray) const;

 private:
  LensRays(geometry::Lens lens, double aspect, const Eigen::Vector2d& shift)
      : lens_(std::move(lens)), aspect_(aspect), shift_(shift) {}
  geometry::Lens lens_;
  double aspect_;
  Eigen::Vector2d shift_;
};

struct BundleState {
  SharedLens lens;
  std::vector<std::optional<Eigen::Matrix3d>> R_head_rig;
};

struct BundleFit {
  BundleState state;
  std::vector<bool> used;  ///< by match
  double error = 0;        ///< median distance of the used matches' two rays, units of radius
};

struct BundleRules {
  SharedLens prior;               ///< what coefficients and aspect are expected to be near
  std::size_t first = 0;          ///< the head that keeps its rotation
  bool free_aspect = false;       ///< the pixels' aspect is estimated
  std::array<double, 2> sigma{};  ///< standard deviations of the lens's coefficients about those of `prior`
  double shift_sigma = 0;         ///< of the lens's axis, units of radius
  double stated_focal = 0;        ///< by the camera, units of radius; 0: it does not say
};

/// Matches of heads without a rotation are not used.
BundleFit adjust(BundleState start, const std::vector<UnitMatch>& matches, const BundleRules& rules);

}  // namespace nodal::autocalibration
