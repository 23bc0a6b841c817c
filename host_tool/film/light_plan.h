// How bright each head of a film is beside the others, over time.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/film/film_plan.h"
#include "host_tool/film/programs.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// One moment: how much more light each head recorded than the mean of the heads, stops; not a number: not known.
using LightMoment = std::vector<double>;

/// Moments as they are put into a plan: what only one moment shows, such as a flash, is left out, and what is not known
/// at one is taken from the others. Empty if all heads are so near the mean that nobody sees it.
PlannedLight light_of(const std::vector<std::uint64_t>& frames, const std::vector<LightMoment>& moments);

/// Measures it where heads overlap, in one frame of kLightFrames, or more often in short films. `go_on`: is told the
/// part that is done, 0 to 1; false: stop. `notes`: a whole sentence for the user on each head that is matched.
/// Errors: those of the decoders; kCancelled.
Status plan_light(FilmPlan& plan, const Programs& programs, const std::function<bool(double)>& go_on,
                  std::vector<std::string>& notes);
inline constexpr std::uint64_t kLightFrames = 240;

}  // namespace nodal::film
