// Joins the segments of a film, without coding them again, and adds its sound and its metadata.
#pragma once

#include <string>
#include <vector>

#include "host_tool/film/film_plan.h"
#include "host_tool/film/segments.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// "0-3, 7"; empty: none is missing. Reads every segment.
std::string missing_segments(const FilmPlan& plan, const PartsFolder& parts);

/// Whether the film's sound stays as it is coded: its clock runs as the picture's, and the container holds it.
bool sound_is_copied(const FilmPlan& plan);

/// Makes `out` under a temporary name beside it, and renames it when it is whole and on disk. The parts stay.
/// Errors: kNotReady, naming the segments that are missing; kExists; kDiskFull; kIo.
Status join(const FilmPlan& plan, const PartsFolder& parts, const std::string& out, const Programs& programs);

/// Removes the plan, the segments and what attempts have left, and then the folder unless it holds something else.
void remove_parts(const PartsFolder& parts);

}  // namespace nodal::film
