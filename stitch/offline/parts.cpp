#include "stitch/offline/parts.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstring>
#include <string>

#include "protocol/base/try.h"
#include "protocol/calibration_limits.h"
#include "stitch/blend/blend_table.h"
#include "stitch/geometry/head.h"

namespace nodal::offline {
namespace {

using HeadsOfBlock = std::bitset<kMaxCalibratedHeads>;

constexpr int kBlock = blend::GridTable::kBlockTiles * blend::kTile;  ///< px
/// px between the rays that are tried: first few of a block, then all if these do not tell the heads well enough apart.
constexpr int kCoarse = 8, kFine = 1;

/// Whether the head may see a ray that is within `slack` (rad) of this one.
bool may_see(const geometry::Head& head, double centre_density, const geometry::Ray& ray, double slack) {
  const std::optional<geometry::Pixel> pixel = head.project(ray);
  if (!pixel) {
    const Eigen::Vector3d axis = head.axis().direction();
    return std::atan2(axis.cross(ray.direction()).norm(), axis.dot(ray.direction())) < head.lens().max_angle() + slack;
  }
  const double px_per_radian = std::sqrt(std::max(centre_density, head.density(*pixel)));
  return head.distance_to_edge_without_masks(*pixel) > -1.5 * slack * px_per_radian;
}

/// The heads that may see a ray of the block; a superset.
HeadsOfBlock heads_of_block(const std::vector<geometry::Head>& heads, const std::vector<double>& densities,
                            const geometry::RaymapLayout& layout, int left, int top, int probe) {
  // No layout here has pixels farther apart than 4 / sqrt(pixels) rad; probe / sqrt(2) of them lie between two probes.
  const double slack = 4 * probe / std::sqrt(static_cast<double>(layout.width()) * layout.height());
  HeadsOfBlock seen;
  for (int y = top; y <= top + kBlock; y += probe) {
    for (int x = left; x <= left + kBlock; x += probe) {
      const std::optional<geometry::Ray> ray =
          layout.ray(std::clamp(x + 0.5, 0.5, layout.width() - 0.5), std::clamp(y + 0.5, 0.5, layout.height() - 0.5));
      if (!ray) continue;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        if (!seen[h] && may_see(heads[h], densities[h], *ray, slack)) seen.set(h);
      }
    }
  }
  return seen;
}

}  // namespace

Blocks Blocks::of(int width, int height) { return {(width + kBlock - 1) / kBlock, (height + kBlock - 1) / kBlock}; }

Result<std::vector<Part>> cut_into_parts(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                         std::size_t most) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(calibration));
  const Blocks blocks = Blocks::of(layout.width(), layout.height());
  const std::size_t count = static_cast<std::size_t>(blocks.across) * static_cast<std::size_t>(blocks.down);
  std::vector<Part> parts;
  if (heads.size() <= most) {
    parts.push_back({{}, std::vector<bool>(count, true)});
    for (std::size_t h = 0; h < heads.size(); ++h) parts.back().heads.push_back(h);
    return parts;
  }
  if (layout.scattered()) {
    return fail(Errc::kUnsupported,
                fmt::format("{} heads; a {} raymap is for up to {}", heads.size(), layout.name(), most));
  }
  std::vector<double> densities;
  for (const geometry::Head& head : heads) {
    const Region& region = head.calibration().region;
    densities.push_back(head.density({(region.left + region.right) / 2, (region.top + region.bottom) / 2}));
  }
  std::vector<HeadsOfBlock> heads_of_part;
  for (std::size_t b = 0; b < count; ++b) {
    const int left = static_cast<int>(b) % blocks.across * kBlock, top = static_cast<int>(b) / blocks.across * kBlock;
    HeadsOfBlock seen = heads_of_block(heads, densities, layout, left, top, kCoarse);
    if (seen.count() > most) seen = heads_of_block(heads, densities, layout, left, top, kFine);
    if (seen.none()) continue;
    if (seen.count() > most) {
      return fail(Errc::kTooLarge, fmt::format("{} pictures show the same part of the sphere ({} raymap, pixel {}, "
                                               "{}); at most {} are blended at one place: leave some of them out",
                                               seen.count(), layout.name(), left, top, most));
    }
    std::size_t p = 0;
    while (p < parts.size() && (heads_of_part[p] | seen).count() > most) ++p;
    if (p == parts.size()) {
      parts.push_back({{}, std::vector<bool>(count)});
      heads_of_part.emplace_back();
    }
    parts[p].blocks[b] = true;
    heads_of_part[p] |= seen;
  }
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (heads_of_part[p][h]) parts[p].heads.push_back(h);
    }
  }
  return parts;
}

Calibration calibration_of(const Part& part, const Calibration& calibration) {
  Calibration some = calibration;
  some.heads.clear();
  for (const std::size_t h : part.heads) some.heads.push_back(calibration.heads[h]);
  return some;
}

PartLayout::PartLayout(const geometry::RaymapLayout& whole, const Part& part)
    : RaymapLayout(whole.width(), whole.height()),
      whole_(whole),
      part_(part),
      blocks_(Blocks::of(whole.width(), whole.height())) {}

bool PartLayout::holds(int x, int y) const {
  const int column = std::clamp(x / kBlock, 0, blocks_.across - 1), row = std::clamp(y / kBlock, 0, blocks_.down - 1);
  return part_.blocks[static_cast<std::size_t>(row) * static_cast<std::size_t>(blocks_.across) +
                      static_cast<std::size_t>(column)];
}

std::optional<geometry::Ray> PartLayout::ray(double x, double y) const {
  return holds(static_cast<int>(x), static_cast<int>(y)) ? whole_.ray(x, y) : std::nullopt;
}

void copy_blocks(const Part& part, const ImageView& from, const MutableImageView& to) {
  const Blocks blocks = Blocks::of(to.width, to.height);
  const std::size_t bytes = is_linear16(to.format) ? 2 : 1;
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(to.format)); ++c) {
    const PlaneView& source = from.planes[c];
    const MutablePlaneView& plane = to.planes[c];
    const PlaneGrid grid = component_grid(to.format, static_cast<int>(c));
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const int b = y * grid.step_y / kBlock * blocks.across + x * grid.step_x / kBlock;
        if (!part.blocks[static_cast<std::size_t>(b)]) continue;
        std::memcpy(plane.data + y * plane.row_stride + x * plane.pixel_stride,
                    source.data + y * source.row_stride + x * source.pixel_stride, bytes);
      }
    }
  }
}

}  // namespace nodal::offline
