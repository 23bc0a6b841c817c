// A first calibration of a rig from its pictures alone: features are matched between the pictures, a lens and rotations
// are found with which most matches agree, and the result is turned upright. Registration refines it.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "protocol/calibration_limits.h"
#include "stitch/autocalibration/lens_evidence.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/autocalibration/misfit.h"
#include "stitch/autocalibration/stance.h"

namespace nodal::autocalibration {

struct Options {
  /// By picture, or empty: the focal length that the camera states, px. Only a first guess.
  std::vector<std::optional<double>> focal_px = {};
  /// By picture, or empty: the direction in it, x right and y down, that is up for people who look at it. (0, -1)
  /// unless its Exif orientation says otherwise.
  std::vector<Eigen::Vector2d> up = {};
  /// By picture, or empty: polygons whose inside is not used (Region::masks); the heads that are found have them, too.
  std::vector<std::vector<std::vector<Region::Point>>> masks = {};
  int threads = 0;                            ///< 0: one per core. The result does not depend on it.
  std::function<void(double done)> progress;  ///< 0..1, on the caller's thread
  std::vector<std::string> files = {};        ///< the pictures' names in messages; the heads' names if it is empty
};

struct Found {
  Calibration calibration;          ///< only the placed heads, in the pictures' order
  std::vector<std::size_t> placed;  ///< indices of the placed pictures
  int matches = 0;                  ///< number of points that two heads see and that agree
  double error_px = 0;              ///< the median distance of such a point's two images, original pixels
  /// Pictures (indices into `placed`) that overlap and share few points, and whose detail does not line up there.
  std::vector<std::pair<std::size_t, std::size_t>> doubtful;
  UpBasis up = UpBasis::kLight;  ///< what decided which way is up
  LensEvidence lens;             ///< at which radii the points determine the lens
  double unit_px = 1;            ///< unit of the radii in `lens`, original pixels of the first placed picture
  std::vector<Misfit> misfits;   ///< why pictures are not placed; indices of pictures
  std::vector<Match> points;     ///< matches that agree; heads are indices into `placed`
};

/// `pictures`: at least two, grey (kGrey8), taken at one place with equal lenses. `names`: the heads' names.
///
/// Threading: thread-safe; starts `threads` of its own.
/// Errors: kBadValue for fewer than two pictures, or for more than kMaxPictures; kNoCoverage if no two pictures have
///   enough in common, or if what they have in common contradicts itself; kHeadMismatch for two equal pictures, and
///   for two that would fit if one of them were mirrored or had another focal length.
Result<Found> autocalibrate(const std::vector<DecodedImage>& pictures, const std::vector<std::string>& names,
                            const Options& options);

inline constexpr std::size_t kMaxPictures = kMaxCalibratedHeads;

}  // namespace nodal::autocalibration
