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
  std::array<std::uint8_t, kDescriptorSize> descriptor{};
};

/// At most `most` features inside `region`, spread over the picture; those of large scale first, since they are found
/// again more often. The same features in every run.
std::vector<Feature> find_features(const Picture& picture, const Region& region, std::size_t most);

}  // namespace nodal::autocalibration
