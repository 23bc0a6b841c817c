// Matches: pairs of features of two pictures that look alike.
#pragma once

#include <cstddef>
#include <vector>

#include "stitch/autocalibration/features.h"

namespace nodal::autocalibration {

struct Match {
  std::size_t a = 0, b = 0;  ///< indices of pictures, a < b
  geometry::Pixel pixel_a, pixel_b;
  double scale = 0;  ///< size of the blobs, rms of both, px of the pictures in which they are found; 0: unknown
};

/// How many features look like two or more places of another picture, so that the nearest descriptor means nothing.
struct Repetition {
  std::size_t features = 0;
  std::size_t ambiguous = 0;  ///< features that are about as similar to two features of the other picture

  /// Whether a large share of the features is ambiguous: below 1 % where nothing repeats, 40 % if tiles are everywhere.
  bool prevails() const;
  void add(const Repetition& other) {
    features += other.features;
    ambiguous += other.ambiguous;
  }
};

/// Matches of two pictures: each feature's descriptor is the nearest to the other's, and clearly nearer than the second
/// nearest (Lowe's ratio test). Some matches are wrong. `repetition`, if given, counts the features of the first
/// picture.
std::vector<Match> find_matches(std::size_t a, const std::vector<Feature>& in_a, std::size_t b,
                                const std::vector<Feature>& in_b, Repetition* repetition = nullptr);

}  // namespace nodal::autocalibration
