// The heads' own pictures, from a film of each head: the films of a take that `nodal take export` wrote, or others.
#pragma once

#include <string>
#include <vector>

#include "host_tool/input/pictures.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Whether there is something, and all of it is films.
bool are_films(const std::vector<std::string>& files);

/// Up to `sets` sets, spread evenly over the time that all films cover; all are decoded. A picture of another film
/// belongs to a set if it is at most half a picture's time away; sets that lack one are passed over. A note says which
/// moments they are.
/// Errors: those of open_matroska() and decode_image(); kBadValue for films without a common time.
Result<std::vector<std::vector<HeadPicture>>> film_pictures(const std::vector<std::string>& files, int sets,
                                                            std::vector<std::string>& notes);

}  // namespace nodal::host
