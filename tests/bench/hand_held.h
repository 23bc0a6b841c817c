// Sets of pictures as people take them from the hand, turning around, rendered by the simulator: placed by Nodal and by
// Hugin, and judged by the truth and by points of the scene that neither program has used.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"
#include "tests/support/rendered_rig.h"

namespace nodal::bench {

struct HandHeldSet {
  double moved = 0;         ///< how far the eye is from the middle, at most, m along each axis; half of it up and down
  bool near = false;        ///< columns stand 1.5 to 2 m away; else nothing is nearer than the walls, 6 m away
  bool own_lenses = false;  ///< focal lengths that differ by up to 1 %, as of a zoom that was touched
};
/// The campaign's sets, 0 to 19: every combination of five distances, near things or none, one lens or differing ones.
HandHeldSet hand_held_set(int number);

/// 10 to 13 pictures around the horizon, about upright.
Calibration true_hands(const HandHeldSet& set, int seed);
test::Room room_of(const HandHeldSet& set);
test::RenderedRig rendered_hands(const HandHeldSet& set, const Calibration& truth, int seed);

/// A point of the scene in two pictures, px.
struct KeptPoint {
  std::size_t a = 0, b = 0;
  geometry::Pixel at_a, at_b;
};
/// Points at random places of the first head's picture that the second one sees, too, from the truth: both programs
/// work from pictures, so none of them is fitted. For each two heads that overlap.
std::vector<KeptPoint> kept_points(const test::Room& room, const Calibration& truth, int seed);

/// Heads of a set that a program placed; the others are empty.
using Placed = std::vector<std::optional<HeadCalibration>>;

struct HandErrors {
  double rms_deg = 0, max_deg = 0;  ///< rms and largest error of the rotations
  double kept_deg = 0;              ///< median angle between the rays of a kept point's two images
};
/// Of the heads that `counted` names, which must be placed.
HandErrors errors_of(const Calibration& truth, const Placed& placed, const std::vector<bool>& counted,
                     const std::vector<KeptPoint>& points);

/// Hugin's pto_gen (told the field of view), cpfind, cpclean and autooptimiser in `folder`. Heads without a control
/// point are not placed.
/// Errors: kIo with what the program said; those of reading its project.
Result<Placed> placed_by_hugin(const std::vector<std::string>& files, double view_deg,
                               const std::filesystem::path& folder);

}  // namespace nodal::bench
