// Features: points of a picture that can be found again in another one, whatever its scale and its rotation (SIFT, Lowe
// 2004). They are found by VLFeat.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/autocalibration/picture.h"
#include "stitch/geometry/ray.h"

namespace nodal::autocalibration {

inline constexpr std::size_t kDescriptorSize = 128;

struct Feature {
  geometry::Pixel pixel;
  double scale = 1;  ///< size of the blob, px of the picture in which it is found
  std::array<std::uint8_t, kDescriptorSize> descriptor{};
};

/// At most `most` features inside `region`, spread over the picture. Those of middle scale come first: large blobs are
/// found again more often, but their places are less accurate, and the smallest ones are often noise. Every run finds
/// the same features.
std::vector<Feature> find_features(const Picture& picture, const Region& region, std::size_t most);

/// The same in the rim of a region with a circle, from the radius `from_radius` on, px. find_features() keeps away from
/// the circle by the reach of a descriptor; these features are also nearer to it, where the descriptor covers a mirror
/// image of the picture.
std::vector<Feature> find_rim_features(Picture picture, const Region& region, std::size_t most, double from_radius);

}  // namespace nodal::autocalibration
