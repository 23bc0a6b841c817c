// What masks cost: rays that no head sees, and that a head would see without its masks.
#pragma once

#include <string>
#include <vector>

#include "stitch/geometry/head.h"

namespace nodal::geometry {

struct MaskHole {
  std::size_t head = 0;
  double solid_angle_sr = 0;  ///< of the rays that this head's masks hide and no head sees
  Angles towards;             ///< one of them
};

/// By head; only those whose masks leave a hole. Counted over rays of 1.6e-4 sr (0.5 square degrees); smaller holes may be
/// missed.
std::vector<MaskHole> find_mask_holes(const std::vector<Head>& heads);

/// One sentence for each of them: the head, the solid angle, a direction.
std::vector<std::string> describe(const std::vector<MaskHole>& holes, const std::vector<Head>& heads);

}  // namespace nodal::geometry
