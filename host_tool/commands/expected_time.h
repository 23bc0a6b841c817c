// How long a computation is likely to take, said before it begins.
#pragma once

#include <cstddef>
#include <string>

namespace nodal::host {

/// What is to be done.
struct ExpectedWork {
  std::size_t placed = 0;  ///< pictures whose lens and rotations are found in them; 0: they are known
  double picture_px = 0;   ///< pixels of one of them
  double blended_px = 0;   ///< pixels of spheres
};

/// A sentence such as "this takes about 40 s on this computer"; empty for less than ten seconds. `cores`: those of this
/// computer; 0: unknown, taken for one.
///
/// On an AMD EPYC with 2 cores it was within a factor of two for seven sets of 2 to 18 pictures. Pictures of video
/// whose pixels are not square take four times as long, because their aspect is estimated, too.
std::string expected_time(const ExpectedWork& work, unsigned cores);

}  // namespace nodal::host
