// How long a computation is likely to take, said before it begins.
#pragma once

#include <cstddef>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/input/rig_pictures.h"

namespace nodal::host {

/// What is to be done.
struct ExpectedWork {
  std::size_t placed = 0;      ///< pictures whose lens and rotations are found in them; 0: they are known
  double picture_px = 0;       ///< pixels of one of them
  double blended_px = 0;       ///< pixels of spheres
  std::size_t registered = 0;  ///< pictures that `nodal register` compares with each other
};

/// What `nodal register` is to do. `alone`: lens and rotations are found in the pictures.
ExpectedWork registration_of(RigPictures& rig, bool alone);

/// Pixels of a picture; 0 if it cannot be read, which is an error later.
double pixels_of(HeadPicture& picture);

/// A sentence such as "this takes about 40 s on this computer"; empty for less than ten seconds. `cores`: those of this
/// computer; 0: unknown, taken for one.
///
/// On an AMD EPYC with 2 cores it was within a factor of two for seven sets of 2 to 18 pictures. Pictures of video
/// whose pixels are not square take four times as long, because their aspect is estimated, too.
std::string expected_time(const ExpectedWork& work, unsigned cores);

/// Says the sentence, if there is one, as a note.
void say_time(Console& console, const ExpectedWork& work);

}  // namespace nodal::host
