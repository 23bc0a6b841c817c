// Values that heads recorded of the same light: of one ray by several heads, or of one ray by one head under several
// exposures.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/geometry/head.h"

namespace nodal::calibration {

/// Pictures that one trigger exposed: one a head, RGB24, in the calibration's order.
struct ExposedSet {
  std::string name;
  std::vector<ImageView> frames;
  /// How much more light than the other sets, when it is known: 1 is twice as much.
  std::optional<double> stops;
};

/// One channel of a small patch of one picture.
struct Observation {
  int head = 0;
  int channel = 0;
  double value = 0;   ///< encoded, 0..1, mean over the patch
  double s = 0;       ///< squared distance from the lens's centre over the radius of fall_off_radius()
  double stops = 0;   ///< of the set
  double weight = 1;  ///< one over the variance of the value's logarithm
};

/// Observations of one light; group g is all[first[g]] .. all[first[g + 1] - 1].
struct LightGroups {
  std::vector<Observation> all;
  std::vector<std::size_t> first{0};

  std::size_t size() const { return first.size() - 1; }
};

/// Where the fall-off is measured from and against: the lens's centre, half the picture's diagonal with the aspect
/// taken out, px.
double fall_off_radius(const HeadCalibration& head);

/// Rays spread evenly over the sphere, each by all heads that see it; sets apart.
LightGroups shared_rays(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets);

/// Places spread evenly over each head's picture, each by all sets whose stops are known. The scene must stand still;
/// the fit rejects moving things as outliers.
LightGroups same_places(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets);

}  // namespace nodal::calibration
