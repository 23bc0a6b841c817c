// How the heads of a rig stand, and which lens they share, from matches alone.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/autocalibration/lens_evidence.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/autocalibration/unit_lens.h"

namespace nodal::autocalibration {

/// What is known of a picture before anything is estimated.
struct Shape {
  int width = 0;
  int height = 0;
  std::optional<Region::Circle> circle;             ///< image circle of a fisheye, px
  std::optional<double> focal_px = std::nullopt;    ///< focal length that the camera states; only a first guess
  std::vector<std::vector<Region::Point>> masks{};  ///< polygons whose inside is not used, px

  /// About where the lens's axis is: the circle's centre, or the picture's.
  geometry::Pixel center() const;
  /// The unit of radii, px: the circle's radius, or half of the longer side.
  double unit() const;
};

/// A head's lens, as far as it differs from the shared one.
struct LensDifference {
  double log_focal = 0;
  Eigen::Vector2d shift{0, 0};  ///< shift of its axis, units
};

struct Arrangement {
  SharedLens lens;
  std::vector<LensDifference> own;  ///< by head; empty: all lenses are equal
  LensEvidence evidence;
  std::vector<std::optional<Eigen::Matrix3d>> R_head_rig;  ///< empty for a head that no matches connect

  SharedLens lens_of(std::size_t head) const;
  std::vector<Match> used;  ///< matches that agree
  double error = 0;  ///< median distance of the used matches' points from where the other head says they are, units
};

/// How far a rotation between two pictures can be trusted with a lens; 0: not at all. Empty: the number of matches
/// decides.
using Trust = std::function<double(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens)>;
struct Checks {
  Trust quick;     ///< called for every lens that is tried: how many matches agree
  Trust thorough;  ///< called with the best lens: how well the pictures agree where they overlap
};

/// How much fisheyes overlap. Where only their rims do, a lens must be almost right for matches to agree.
enum class Overlap : std::uint8_t { kWide, kThin };

/// Tries lenses from tele to fisheye (Kannala-Brandt with two coefficients; pixels that are not square for the sizes of
/// BT.601), and for each one finds the rotations on which most matches agree; the best of these starts go through a
/// bundle adjustment of all rotations and the lens. Lenses that nobody builds are refused. Where matches do not
/// determine the lens, it is that of a family (see LensEvidence). `progress`: 0..1, on the caller's thread.
///
/// Threading: thread-safe; starts `threads` of its own (0: one per core). The result does not depend on their number.
/// Errors: kNoCoverage with the cause, without advice, if no two pictures have enough matches in common, or if these
///   contradict what the pictures show, or every lens.
Result<Arrangement> find_arrangement(const std::vector<Shape>& shapes, const std::vector<Match>& matches, int threads,
                                     const Checks& checks = {}, Overlap overlap = Overlap::kWide,
                                     const std::function<void(double)>& progress = {});

}  // namespace nodal::autocalibration
