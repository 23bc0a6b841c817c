// Values recorded for the same light: for one ray by several heads, or for one ray by one head under several
// exposures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/geometry/head.h"

namespace nodal::calibration {

/// Pictures of one trigger: one per head, RGB24, in the calibration's order.
struct ExposedSet {
  std::string name;
  std::vector<ImageView> frames;
  /// Light relative to the other sets, if known; 1 is twice as much.
  std::optional<double> stops;
};

/// One channel of a small patch of one picture.
struct Observation {
  int head = 0;
  int channel = 0;
  double value = 0;   ///< encoded, 0..1, mean over the patch
  double s = 0;       ///< squared distance from the lens's centre, relative to fall_off_radius()
  double stops = 0;   ///< exposure of the set, stops
  double weight = 1;  ///< inverse variance of the value's logarithm
};

/// Observations of one light; group g is all[first[g]] .. all[first[g + 1] - 1].
struct LightGroups {
  std::vector<Observation> all;
  std::vector<std::size_t> first{0};

  std::size_t size() const { return first.size() - 1; }
};

/// The radius in which fall-off is expressed: half the picture's diagonal with the aspect divided out, px. Fall-off is
/// measured from the lens's centre.
double fall_off_radius(const HeadCalibration& head);

/// Rays spread evenly over the sphere, each seen by several heads; every set is sampled separately.
LightGroups shared_rays(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets);

/// Points spread evenly over each head's picture, each in all sets with known stops. The scene must not move; the fit
/// rejects moving objects as outliers.
LightGroups same_places(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets);

}  // namespace nodal::calibration
