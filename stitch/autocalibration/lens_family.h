// Families of lenses that are built: what is assumed of a lens where pictures do not show it.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "protocol/calibration.h"

namespace nodal::autocalibration {

enum class Family : std::uint8_t {
  kEquidistant,    ///< r = f a
  kEquisolid,      ///< r = 2 f sin(a / 2)
  kStereographic,  ///< r = 2 f tan(a / 2)
  kOrthographic,   ///< r = f sin(a)
  kRectilinear,    ///< r = f tan(a)
};
std::string_view family_name(Family family);

/// The families whose lenses reach the angle `edge`, rad, with room to spare. The first one is the commonest of those.
std::vector<Family> families_reaching(double edge);

/// The family's Kannala-Brandt coefficients, with focal length 1: closer to it than 0.3 % of the radius up to its end.
KannalaBrandtLens family_lens(Family family);

/// Standard deviations of k1 and k2 about those of a family: `part` of the radius at the angle `edge`.
std::array<double, 2> family_sigma(double edge, double part);

}  // namespace nodal::autocalibration
