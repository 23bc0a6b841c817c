// How the heads of a rig stand, and which lens they share, from matches alone.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/autocalibration/matches.h"

namespace nodal::autocalibration {

/// What is known of a picture before anything is estimated.
struct Shape {
  int width = 0;
  int height = 0;
  std::optional<Region::Circle> circle;           ///< of a fisheye, px
  std::optional<double> focal_px = std::nullopt;  ///< as the camera says; only a first guess

  /// About where the lens's axis is: the circle's centre, or the picture's.
  geometry::Pixel center() const;
  /// The unit of radii, px: the circle's radius, or half of the longer side.
  double unit() const;
};

/// One lens for all heads; radii in units of each picture's Shape::unit().
struct SharedLens {
  KannalaBrandtLens model;
  double aspect = 1;            ///< height of a unit / its width, as in the calibration
  Eigen::Vector2d shift{0, 0};  ///< of the lens's axis from Shape::center(), units
};

struct Arrangement {
  SharedLens lens;
  std::vector<std::optional<Eigen::Matrix3d>> R_head_rig;  ///< nothing for a head that matches do not connect
  std::vector<Match> used;                                 ///< matches that agree
  double error = 0;  ///< median distance of the used matches' two rays, units of radius
};

using Trust = std::function<double(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens)>;

/// Tries lenses from tele to fisheye (Kannala-Brandt with two coefficients; pixels that are not square for the sizes of
/// BT.601), and for each one finds the rotations on which most matches agree; the best of these starts go through a
/// bundle adjustment of all rotations and the lens.
///
/// Threading: thread-safe; starts `threads` of its own (0: one per core). The result does not depend on their number.
/// `trust`: how far two pictures show the same where they overlap with this rotation and lens, 0: they do not; empty: the
/// number of matches decides.
/// Errors: kNoCoverage if no two pictures have enough matches in common.
Result<Arrangement> find_arrangement(const std::vector<Shape>& shapes, const std::vector<Match>& matches, int threads,
                                     const Trust& trust = {});

}  // namespace nodal::autocalibration
