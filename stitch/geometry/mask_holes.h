// Finds the holes caused by masks: rays that no head sees, but that a head would see without its masks.
#pragma once

#include <string>
#include <vector>

#include "stitch/geometry/head.h"

namespace nodal::geometry {

struct MaskHole {
  std::size_t head = 0;
  double solid_angle_sr = 0;  ///< solid angle of the rays that this head's masks cover and that no head sees
  Angles towards;             ///< one of them
};

/// By head; only heads whose masks leave a hole. Sampled with rays of 1.6e-4 sr (0.5 square degrees), so smaller holes
/// may be missed.
std::vector<MaskHole> find_mask_holes(const std::vector<Head>& heads);

/// One sentence for each hole: the head, the solid angle, a direction.
std::vector<std::string> describe(const std::vector<MaskHole>& holes, const std::vector<Head>& heads);

}  // namespace nodal::geometry
