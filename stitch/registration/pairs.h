// Point pairs (§4.4): pixels of two heads that show the same point of the scene, set by hand or found by another
// program. They place heads at any distance from the prior, less accurately than the pictures: a start for
// registration.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// One point of the scene in the pictures of two heads; a pixel's centre is at + 1/2.
struct PointPair {
  std::size_t head_a = 0;
  geometry::Pixel pixel_a;
  std::size_t head_b = 0;
  geometry::Pixel pixel_b;
};

/// How well the pairs of two heads agree.
struct PairAgreement {
  std::size_t a = 0, b = 0;  ///< heads, a < b
  int used = 0, rejected = 0;
  double rms_deg = 0, worst_deg = 0;  ///< rms and largest error of the used pairs
};

struct PairFit {
  Calibration calibration;
  std::vector<HeadReport> heads;
  std::vector<PairAgreement> agreements;
  std::vector<bool> used;  ///< one per pair: false for outliers
  double rms_deg = 0;      ///< rms error of all used pairs
  std::vector<std::string> warnings;
};

/// Estimates rotations (with Free::kFocals focal lengths, too) that bring the pairs' rays together: an initial solution
/// from two consistent pairs of two heads, then a bundle adjustment on the rays with Huber's norm. If the pairs do not
/// connect all heads, the largest connected group is placed; the first head of this group keeps its rotation.
///
/// Threading: thread-safe.
/// Errors: kBadValue for a pair with an unknown head or a pixel outside its lens; kNoCoverage if no two heads have two
///   pairs; kHeadMismatch if the pairs contradict each other.
Result<PairFit> fit_to_pairs(const Calibration& prior, const std::vector<PointPair>& pairs, Free free);

}  // namespace nodal::registration
