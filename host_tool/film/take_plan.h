// The plan of a film of a take.
#pragma once

#include <string>
#include <vector>

#include "host_tool/film/film_plan.h"
#include "protocol/base/units.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::film {

/// What a user asks for. The raymap is that of the take's rig.toml, or what was changed in it.
struct TakeRequest : FilmLook {
  std::string calibration;  ///< ID of the one that is used instead of the take's; empty: the take's
  Duration from{};          ///< time of the take
  Duration to = Duration::seconds(1'000'000'000);
};

/// The request in words, with the take's identity.
Json words_of(const TakeRequest& request, const media::TakeFolder& take, const Programs& programs);

/// The plan without placed seams: the raymap of the take that is nearest to each instant of the result. Reads the
/// take's evidence, no pictures. `notes`: whole sentences for the user.
/// Errors: those of TakeFolder; kNotFound if the take has nothing between `from` and `to`; those of check().
Result<FilmPlan> make_plan(const TakeRequest& request, const media::TakeFolder& take, const Programs& programs,
                           std::vector<std::string>& notes);

}  // namespace nodal::film
