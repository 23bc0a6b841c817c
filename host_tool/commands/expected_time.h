// How long a computation is likely to take, said before it begins.
#pragma once

#include <cstddef>
#include <string>

namespace nodal::host {

/// What is to be done. Its time was measured on a current x86-64 with sets of 2 to 10 pictures: within a factor of two.
struct ExpectedWork {
  std::size_t calibrated = 0;  ///< pictures whose calibration is found in them, for a sphere
  std::size_t registered = 0;  ///< pictures that are registered only
  double blended_px = 0;       ///< pixels of spheres
};

/// A sentence such as "this takes about 40 s on this computer"; empty for less than ten seconds. `cores`: of this
/// computer; 0: unknown, taken for one.
std::string expected_time(const ExpectedWork& work, unsigned cores);

}  // namespace nodal::host
