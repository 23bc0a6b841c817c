// A head's picture as triangles in the head's own axes, so that a page that turns the triangles shows the picture
// through its lens.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/head.h"

namespace nodal::host::look {

struct HeadGrid {
  std::vector<std::uint8_t> glb;  ///< unit vectors; places in the picture as texture coordinates
  double error_deg = 0;           ///< largest error of the triangles, measured in the middle of their edges
};

/// As coarse as `max_error_deg` permits. Triangles that reach over the edge of what may be used are left out, so up to
/// a hundredth of the picture's width is missing there.
/// Errors: kNoCoverage for a head of which nothing may be used.
Result<HeadGrid> grid_of(const geometry::Head& head, double max_error_deg);

}  // namespace nodal::host::look
