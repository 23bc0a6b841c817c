// Point pairs (§4.4): what two heads saw of one thing, by hand or by another program's features, places heads however
// far they stand from the prior. Less exact than the pictures themselves: a place to start from.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// One thing in the world as two heads saw it; a pixel's centre is at + 1/2.
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
  double rms_deg = 0, worst_deg = 0;  ///< of those used
};

struct PairFit {
  Calibration calibration;
  std::vector<HeadReport> heads;
  std::vector<PairAgreement> agreements;
  std::vector<bool> used;  ///< one a pair: false for what contradicts the rest
  double rms_deg = 0;      ///< of all that are used
  std::vector<std::string> warnings;
};

/// Turns the heads until the pairs' rays meet: a start from any two pairs of two heads that agree, then a bundle
/// adjustment on the rays with Huber's norm. With Free::kFocals focal lengths, too. Of islands that no pairs join
/// the largest is placed; the first of its heads stays.
///
/// Threading: thread-safe.
/// Errors: kBadValue for a pair of a head that is not there or a pixel outside its lens; kNoCoverage when no two heads
///   have two pairs; kHeadMismatch when the pairs contradict each other.
Result<PairFit> fit_to_pairs(const Calibration& prior, const std::vector<PointPair>& pairs, Free free);

}  // namespace nodal::registration
