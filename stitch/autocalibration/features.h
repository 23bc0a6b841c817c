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

/// At most `most` features inside `region`, spread over the picture; those of middle scale first: large blobs are found
/// again more often, but their places are less accurate, and the smallest ones are often noise. The same features in
/// every run.
std::vector<Feature> find_features(const Picture& picture, const Region& region, std::size_t most);

/// The same of the rim of a region with a circle, from `from_radius` on, px. Other features are at least as far from
/// the circle as their descriptors reach; these also where descriptors reach beyond, into the mirrored picture.
std::vector<Feature> find_rim_features(Picture picture, const Region& region, std::size_t most, double from_radius);

}  // namespace nodal::autocalibration
