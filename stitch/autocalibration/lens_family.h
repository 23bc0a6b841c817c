// Families of lenses that are built: they say how a lens goes on where pictures do not show it.
#pragma once

#include <array>
#include <optional>
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
/// Nothing if no family has this name.
std::optional<Family> family_named(std::string_view name);

/// The families whose lenses reach beyond the angle `edge`, rad, the commonest one first.
std::vector<Family> families_reaching(double edge);

/// The family as a Kannala-Brandt lens with focal length 1; it differs by less than 0.3 % of the radius.
KannalaBrandtLens family_lens(Family family);
/// The same for angles up to `reach`, rad: by less than 0.04 % of the radius up to 120 degrees, rectilinear lenses
/// excepted.
KannalaBrandtLens family_lens(Family family, double reach);

/// Standard deviations of k1 and k2 about those of a family: `part` of the radius at the angle `edge`.
std::array<double, 2> family_sigma(double edge, double part);

}  // namespace nodal::autocalibration
