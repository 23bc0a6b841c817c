// Matches: pairs of features of two pictures that look alike.
#pragma once

#include <vector>

#include "stitch/autocalibration/features.h"

namespace nodal::autocalibration {

struct Match {
  std::size_t a = 0, b = 0;  ///< indices of pictures, a < b
  geometry::Pixel pixel_a, pixel_b;
  double scale = 0;  ///< of the blobs, rms of both, px of the pictures in which they are found; 0: unknown
};

/// Matches of two pictures: each feature's descriptor is the other's nearest, and clearly nearer than the second
/// nearest (Lowe's ratio test). Some of them are wrong.
std::vector<Match> find_matches(std::size_t a, const std::vector<Feature>& in_a, std::size_t b,
                                const std::vector<Feature>& in_b);

}  // namespace nodal::autocalibration
