// TileBuilder: which level of a head's pyramid a tile reads.
#include <algorithm>
#include <array>
#include <numbers>
#include <numeric>

#include "stitch/table/tile_builder.h"

namespace nodal::table {
namespace {

using blend::kFractionBits;
using blend::kPatch;

/// From this many samples per raymap pixel on, the next pyramid level (half the size) is used. Its samples are then at
/// most a tenth coarser than the raymap, and closer to the mean over a pixel than interpolation in the larger picture.
constexpr double kFinest = 1.8;
/// A step of more than so many times the median of a part's goes over an edge between two faces of the layout, whose
/// samples the same patch holds. Within a face, steps of a tile differ by less, also beside a pole.
constexpr double kOverEdge = 4;

}  // namespace

/// The mean squared step from pixel to pixel, in samples, along rows or along columns, whichever is larger; nothing for
/// parts without neighbouring pixels. Samples that were clamped to the picture's edge, and steps over an edge of the
/// layout, are ignored. Where all steps are so short that the finest level is taken, the largest of them instead.
std::optional<double> TileBuilder::square_step(const Part& part) const {
  if (sampler_.layout().scattered()) return square_between_rays(part);
  const RaySampler::Plane& plane = sampler_.plane(grid_, part.head);
  const auto moved = [&](std::size_t p) {
    const auto at_edge = [](std::int32_t at, int size) { return at == 0 || at >= ((size - 1) << kFractionBits) - 1; };
    return at_edge(part.x[p], plane.width) || at_edge(part.y[p], plane.height);
  };
  PixelMask still = 0;
  for_each(part.mask, [&](std::size_t p) { still |= moved(p) ? 0 : PixelMask{1} << p; });
  constexpr double kOne = 1 << kFractionBits;
  double most = 0;
  for (const std::size_t way : {std::size_t{1}, std::size_t{8}}) {
    constexpr PixelMask kLeftOfAnother = 0x7f7f7f7f7f7f7f7f;
    const PixelMask pairs = still & still >> way & (way == 1 ? kLeftOfAnother : ~PixelMask{0});
    if (pairs == 0) return std::nullopt;
    std::array<double, blend::kTilePixels> squares;
    auto end = squares.begin();
    double largest = 0;
    for_each(pairs, [&](std::size_t p) {
      const double dx = part.x[p + way] - part.x[p];
      const double dy = part.y[p + way] - part.y[p];
      largest = std::max(largest, *end++ = dx * dx + dy * dy);
    });
    if (largest <
        kFinest * kFinest * kOne * kOne) {  // as nearly everywhere: the mean is below it, too, and says no more
      most = std::max(most, largest);
      continue;
    }
    const auto middle = squares.begin() + (end - squares.begin()) / 2;
    std::nth_element(squares.begin(), middle, end);
    // Beyond the median all are at least as large.
    const auto kept = std::partition(
        middle, end, [limit = kOverEdge * kOverEdge * *middle](double square) { return square <= limit; });
    most = std::max(most, std::accumulate(squares.begin(), kept, 0.0) / static_cast<double>(kept - squares.begin()));
  }
  return most / (kOne * kOne);
}

/// The same for scattered rays, which have no rows and columns: samples per ray, if rays are spread evenly.
double TileBuilder::square_between_rays(const Part& part) const {
  const RaySampler::Grid& grid = sampler_.grids()[static_cast<std::size_t>(grid_)];
  const PlaneGrid& plane_grid = sampler_.plane(grid_, part.head).on_picture;
  const auto p = static_cast<std::size_t>(__builtin_ctzll(part.mask));
  const auto along = [](std::int32_t at, double offset, int step) {
    return (at / static_cast<double>(1 << kFractionBits) + 0.5 - offset) * step;
  };
  const double density =
      sampler_.heads()[part.head].density({along(part.x[p], plane_grid.offset_x, plane_grid.step_x),
                                           along(part.y[p], plane_grid.offset_y, plane_grid.step_y)});
  return density * 4 * std::numbers::pi / (static_cast<double>(grid.width) * grid.height) /
         (plane_grid.step_x * plane_grid.step_y);
}

/// Chooses for each part the pyramid level whose samples are about as far apart as the raymap's pixels, in the
/// direction of the larger step, so that it does not alias. Parts without square_step() take the coarsest level of the
/// others.
void TileBuilder::choose_levels() {
  int others = 0;
  for (const bool small : {false, true}) {
    for (Part& part : parts_) {
      std::optional<double> square = square_step(part);
      if (square.has_value() == small) continue;
      const RaySampler::Plane& plane = sampler_.plane(grid_, part.head);
      const int most = sampler_.options().levels - 1;
      while (part.level < most && (small ? part.level < others : *square >= kFinest * kFinest) &&
             std::min(plane.width, plane.height) >> (part.level + 1) >= kPatch) {
        if (square) *square /= 4;
        ++part.level;
      }
      others = std::max(others, part.level);
    }
  }
  for (Part& part : parts_) shrink(part);
}

/// Converts a part's coordinates to the plane of its level.
void TileBuilder::shrink(Part& part) const {
  if (part.level == 0) return;
  const RaySampler::Plane& plane = sampler_.plane(grid_, part.head);
  const auto smaller = [&](std::int32_t at, int size) {
    const std::int32_t half = 1 << (kFractionBits - 1);
    return std::clamp<std::int32_t>(((at + half) >> part.level) - half, 0,
                                    (((size >> part.level) - 1) << kFractionBits) - 1);
  };
  for_each(part.mask, [&](std::size_t p) {
    part.x[p] = smaller(part.x[p], plane.width);
    part.y[p] = smaller(part.y[p], plane.height);
  });
}

}  // namespace nodal::table
