// What the sums at a result say about it: how accurate it is, and whether lenses or near things explain what remains.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/objective.h"
#include "stitch/registration/parameters.h"

namespace nodal::registration {

/// Standard deviations of the estimated parameters. Squared, they are the sum of
/// - noise, or, if it is larger, the contradiction between parts of the sphere, by a jackknife: the spread of the
///   results without one part each. Near or moving things count as far as they pull in different directions;
/// - the change of the result if lenses, or the distance of what is seen, were estimated too: errors that are the same
///   everywhere, which no spread shows;
/// - for rotations, a hundredth of a pixel, because interpolation and blur are not exact.
struct Certainty {
  std::vector<double> rotation_rad;  ///< about the worst axis, relative to the gauge; 0 for the head that is held
  std::vector<double> bias_rad;      ///< the part of it that is due to lenses and the distance, by linear steps
  std::vector<double> log_focal;     ///< 0 if not estimated
  double nearness = 0;               ///< 1/m; 0 if not estimated

  /// The share of the objective that one more step would remove if focal lengths, whole lenses or one distance were
  /// estimated, too. Close to 0 if the lenses are right or nothing is near, independent of noise.
  double by_focals = 0, by_lenses = 0, by_distance = 0;
  double distance_nearness = 0;  ///< 1 / that distance, 1/m; 0 if no head has a position
  /// The share of the objective that would go if the heads were turned differently in every part of the sphere, without
  /// what noise alone explains. Close to 0 where one rotation per head fits everywhere; large if lenses are wrong, or
  /// if things are near, because then displacements depend on what a part shows.
  double by_parts = 0;
  /// The size of what by_parts counts: by how much the heads' pictures are displaced against each other after the
  /// rotations, rms where they show detail, without what noise alone explains, px of the pictures. Extrapolated
  /// from two widths of parts; a test holds it to 1/1.3 to 1.1 of the truth.
  double parts_px = 0;
};

/// `mean_of`: relative to the mean of these heads; empty: to the head that is held.
/// Errors: those of Objective::evaluate().
Result<Certainty> certainty_of(Objective& objective, const std::vector<HeadState>& heads, const Sought& sought,
                               const Held& held, double pixels_a_sample, const std::vector<bool>& mean_of,
                               const parallel::Workers& workers);

}  // namespace nodal::registration
