// Seams where the pictures agree: which head shows each pixel of a small equirectangular map.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stitch/bands/layer.h"

namespace nodal::seams {

/// The head that shows each pixel of the map, row by row; kNobody where none sees it.
using Labels = std::vector<std::uint8_t>;
inline constexpr std::uint8_t kNobody = 255;

struct PlacementOptions {
  /// The cost of a seam's length where the pictures agree, in levels (of 255) per pixel of the map.
  double length = 1;
  /// The cost of a pixel whose head has no score, relative to one with the best score, in levels. Small: it places
  /// seams only where the pictures leave the choice.
  double score = 0.1;
  /// Differences up to this are noise, levels.
  double noise = 1;
  /// Larger differences do not count more, levels.
  double largest = 60;
  /// The cost of a pixel that changes its head from one set to the next, levels: seams stay where they are unless
  /// another place is clearly better, so that what does not move does not flicker.
  double change = 2;
};

/// The labels of least cost, found by alpha expansions (Boykov, Veksler and Zabih, PAMI 2001): for one head after the
/// other, the pixels that should go over to it, by a minimum cut. A seam's cost is the sum, along it, of the difference
/// between the two heads' pictures (Kwatra et al., "Graphcut Textures", 2003), per length on the sphere.
///
/// views: one for each head, on one grid; the last channel is the head's score, > 0 where it sees a pixel, the others
/// are colours (levels). At most 255. previous: the labels of the set before, or empty. Without a set before, seams are
/// first placed on a map of about 256 columns, and then moved by a few pixels on maps of twice the size: a minimum cut
/// of wide overlaps of large maps takes many seconds.
/// Memory: 200 bytes a pixel of the map.
Labels place_seams(std::span<const bands::Layer> views, const Labels& previous, const PlacementOptions& options = {});

/// A head's share of a position between the map's pixels.
struct Share {
  std::uint8_t head = 0;
  float part = 0;
};
/// The heads' shares at (u, v), in pixels of the map; the largest share is first. The labels of the pixels around (u,
/// v) are weighted by a quadratic B-spline: lines along which the first head changes are smooth, although the map is
/// coarse. kNobody has no share. Empty if no head's pixels are near.
void shares_at(const Labels& labels, bands::Grid map, double u, double v, std::vector<Share>& shares);

/// The cost of labels, in levels times pixels of the map.
double cost_of(std::span<const bands::Layer> views, const Labels& labels, const PlacementOptions& options = {});

}  // namespace nodal::seams
