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

/// How much of what pictures show looks the same as two or more places of another one, so that nearest descriptors say
/// nothing.
struct Repetition {
  std::size_t features = 0;
  std::size_t ambiguous = 0;  ///< look like a feature of the other picture, and hardly less like a second one

  /// Whether it is much of what they show. Below a hundredth where nothing repeats, two fifths for tiles all over.
  bool prevails() const;
  void add(const Repetition& other) {
    features += other.features;
    ambiguous += other.ambiguous;
  }
};

/// Matches of two pictures: each feature's descriptor is the other's nearest, and clearly nearer than the second
/// nearest (Lowe's ratio test). Some of them are wrong. `repetition`: counts those of the first picture, if it is
/// given.
std::vector<Match> find_matches(std::size_t a, const std::vector<Feature>& in_a, std::size_t b,
                                const std::vector<Feature>& in_b, Repetition* repetition = nullptr);

}  // namespace nodal::autocalibration
