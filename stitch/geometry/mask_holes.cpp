#include "stitch/geometry/mask_holes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

constexpr int kRays = 80'000;

/// Ray i of kRays on a spiral of equal areas.
Ray even_ray(int i) {
  const double y = 1 - (2 * i + 1.0) / kRays;
  const double turn = i * kPi * (1 + std::sqrt(5.0));
  const double r = std::sqrt(1 - y * y);
  return Ray::towards({r * std::sin(turn), y, r * std::cos(turn)});
}

}  // namespace

std::vector<MaskHole> find_mask_holes(const std::vector<Head>& heads) {
  std::vector<MaskHole> holes;
  if (std::ranges::all_of(heads, [](const Head& head) { return head.masks().empty(); })) return holes;
  std::vector<std::optional<MaskHole>> by_head(heads.size());
  for (int i = 0; i < kRays; ++i) {
    const Ray ray = even_ray(i);
    std::vector<std::size_t> hidden;
    bool seen = false;
    for (std::size_t h = 0; h < heads.size() && !seen; ++h) {
      const std::optional<Pixel> pixel = heads[h].project(ray);
      if (!pixel || heads[h].distance_to_edge_without_masks(*pixel) < 0) continue;
      seen = heads[h].contains(*pixel);
      if (!seen) hidden.push_back(h);
    }
    if (seen) continue;
    for (const std::size_t h : hidden) {
      if (!by_head[h]) by_head[h] = MaskHole{h, 0, ray.angles()};
      by_head[h]->solid_angle_sr += 4 * kPi / kRays;
    }
  }
  for (const std::optional<MaskHole>& hole : by_head) {
    if (hole) holes.push_back(*hole);
  }
  return holes;
}

std::vector<std::string> describe(const std::vector<MaskHole>& holes, const std::vector<Head>& heads) {
  std::vector<std::string> sentences;
  for (const MaskHole& hole : holes) {
    char numbers[160];
    std::snprintf(numbers, sizeof numbers, "%.4f sr (%.2f %% of the sphere), such as yaw %.0f, pitch %.0f degrees",
                  hole.solid_angle_sr, hole.solid_angle_sr / (4 * kPi) * 100, hole.towards.theta * 180 / kPi,
                  -hole.towards.phi * 180 / kPi);
    sentences.push_back("the masks of head '" + heads[hole.head].name() +
                        "' leave a hole that no other head sees: " + numbers);
  }
  return sentences;
}

}  // namespace nodal::geometry
