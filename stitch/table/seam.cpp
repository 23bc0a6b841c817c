#include "stitch/table/seam.h"

#include <algorithm>

namespace nodal::table {
namespace {

/// The x of seam.h for `worse` and a head with a larger score. q / |grad q| = (a^2 - b^2) / (2 |b grad a - a grad b|).
double part_of_ramp(const SeamCandidate& worse, const SeamCandidate& better, double width) {
  const double a = better.score;
  const double b = worse.score;
  const double numerator = (a - b) * (a + b);
  const double denominator = width * (b * better.slope - a * worse.slope).norm();
  return numerator < denominator ? std::max(numerator / denominator, (a - b) / (a + b)) : 1.0;
}

}  // namespace

void apply_seam(std::span<SeamCandidate> candidates, double width) {
  for (SeamCandidate& one : candidates) {
    // The largest distance is used: it is continuous where the best head changes, at the corner of three seams.
    double x = 0;
    for (const SeamCandidate& other : candidates) {
      if (other.score > one.score) x = std::max(x, part_of_ramp(one, other, width));
    }
    one.weight = (1 - x) / (1 + x);
  }
}

bool beyond_ramp(const ScoreLimits& better, const ScoreLimits& worse, double width) {
  const double a = better.least, b = worse.most;
  return a > b && (a - b) * (a + b) >= width * (b * better.slope + better.most * worse.slope);
}

}  // namespace nodal::table
