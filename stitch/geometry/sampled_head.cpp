#include "stitch/geometry/sampled_head.h"

#include <algorithm>

namespace nodal::geometry {
namespace {

constexpr int kSamplesAcross = 64;

}  // namespace

std::vector<RayPixel> sample_head(const Head& head) {
  std::vector<RayPixel> samples;
  const Region& region = head.calibration().region;
  const double width = region.right - region.left;
  const double height = region.bottom - region.top;
  const double step = std::max(width, height) / kSamplesAcross;
  const int columns = std::max(2, static_cast<int>(width / step));
  const int rows = std::max(2, static_cast<int>(height / step));
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const Pixel pixel{region.left + width * i / columns, region.top + height * j / rows};
      if (!head.contains(pixel)) continue;
      const auto ray = head.unproject(pixel);
      if (ray) samples.push_back({head.R_head_rig() * head.seen_from_here(ray->direction()), pixel});
    }
  }
  return samples;
}

}  // namespace nodal::geometry
